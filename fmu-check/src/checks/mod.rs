//! The checks, in folders by subject: one file for each group, with a table of its checks at the top; code without checks is in
//! the folder `shared` below it.

#![allow(clippy::unnecessary_wraps, reason = "all probes have one signature")]

mod exchange;
mod file;
pub(super) mod life;
mod process;
mod steps;

use crate::check::Group;

/// Every check.
pub const GROUPS: &[Group] = &[
    Group { name: "archive", title: "The archive", checks: file::archive::CHECKS },
    Group { name: "xml", title: "modelDescription.xml", checks: file::xml::CHECKS },
    Group { name: "variables", title: "Variables, types and units", checks: file::variables::CHECKS },
    Group { name: "structure", title: "Model structure", checks: file::structure::CHECKS },
    Group { name: "terminals", title: "Terminals and icons", checks: file::terminals::CHECKS },
    Group { name: "binary", title: "The binary", checks: file::binary::CHECKS },
    Group { name: "lifecycle", title: "Life cycle", checks: life::lifecycle::CHECKS },
    Group { name: "access", title: "Getting and setting", checks: life::access::CHECKS },
    Group { name: "time", title: "Steps and time", checks: steps::time::CHECKS },
    Group { name: "event-mode", title: "Event mode and early return", checks: steps::event_mode::CHECKS },
    Group { name: "clocks", title: "Clocks", checks: steps::clocks::CHECKS },
    Group { name: "intermediate-update", title: "Intermediate updates", checks: steps::intermediate::CHECKS },
    Group { name: "scheduled-execution", title: "Scheduled Execution", checks: steps::scheduled::CHECKS },
    Group { name: "configuration", title: "Structural parameters", checks: life::configuration::CHECKS },
    Group { name: "exchange", title: "Model Exchange", checks: exchange::model_exchange::CHECKS },
    Group { name: "events", title: "Events of Model Exchange", checks: exchange::events::CHECKS },
    Group { name: "derivatives", title: "Partial derivatives", checks: exchange::sensitivity::CHECKS },
    Group { name: "state", title: "FMU state", checks: life::state::CHECKS },
    Group { name: "logging", title: "Logging", checks: life::logging::CHECKS },
    Group { name: "instances", title: "Instances, threads, loading", checks: process::instances::CHECKS },
    Group { name: "host", title: "Side effects on the importer's process", checks: process::host::CHECKS },
];
