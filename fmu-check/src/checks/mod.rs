//! The checks: one file for each group, with a table of its checks at the top, and files that a group shares.

#![allow(clippy::unnecessary_wraps, reason = "all probes have one signature")]

mod access;
mod archive;
mod author;
mod binary;
mod by_name;
pub(super) mod calls;
mod clock_rules;
mod clocked;
mod clocks;
mod configuration;
mod dependencies;
mod derivatives;
mod event_mode;
mod events;
mod exchange;
mod exchange_held;
mod held;
mod host;
mod instances;
mod intermediate;
mod layered;
mod lifecycle;
mod logging;
mod names;
mod scheduled;
mod schema;
mod schema_rules;
mod sensitivity;
mod starts;
mod state;
mod structure;
mod surroundings;
mod terminals;
mod time;
mod units;
mod values;
mod variables;
mod xml;

use crate::check::Group;

/// Every check.
pub const GROUPS: &[Group] = &[
    Group { name: "archive", title: "The archive", checks: archive::CHECKS },
    Group { name: "xml", title: "modelDescription.xml", checks: xml::CHECKS },
    Group { name: "variables", title: "Variables, types and units", checks: variables::CHECKS },
    Group { name: "structure", title: "Model structure", checks: structure::CHECKS },
    Group { name: "terminals", title: "Terminals and icons", checks: terminals::CHECKS },
    Group { name: "binary", title: "The binary", checks: binary::CHECKS },
    Group { name: "lifecycle", title: "Life cycle", checks: lifecycle::CHECKS },
    Group { name: "access", title: "Getting and setting", checks: access::CHECKS },
    Group { name: "time", title: "Steps and time", checks: time::CHECKS },
    Group { name: "event-mode", title: "Event mode and early return", checks: event_mode::CHECKS },
    Group { name: "clocks", title: "Clocks", checks: clocks::CHECKS },
    Group { name: "intermediate-update", title: "Intermediate updates", checks: intermediate::CHECKS },
    Group { name: "scheduled-execution", title: "Scheduled Execution", checks: scheduled::CHECKS },
    Group { name: "configuration", title: "Structural parameters", checks: configuration::CHECKS },
    Group { name: "exchange", title: "Model Exchange", checks: exchange::CHECKS },
    Group { name: "events", title: "Events of Model Exchange", checks: events::CHECKS },
    Group { name: "derivatives", title: "Partial derivatives", checks: sensitivity::CHECKS },
    Group { name: "state", title: "FMU state", checks: state::CHECKS },
    Group { name: "logging", title: "Logging", checks: logging::CHECKS },
    Group { name: "instances", title: "Instances, threads, loading", checks: instances::CHECKS },
    Group { name: "host", title: "Side effects on the importer's process", checks: host::CHECKS },
];
