//! A first run that fails may fail because of a limit of the checker or because of this computer. It is tried again without the
//! limits on address space and open files, and from another folder if the binary does not load: where it then succeeds, the FMU is not at
//! fault. This also applies if it requests a license.

use crate::check::{Check, Conclusion, Verdict};
use crate::checks::GROUPS;
use crate::lines::SAID;
use crate::runner::{Conditions, OUT_OF_MEMORY, OUT_OF_TIME, Runner};
use fmu_import::guard::kernel_size;
use fmu_import::{Folder, limits};
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Parts of generationTool of tools whose FMUs look for a license where they run, unless they were exported with a special option.
const LICENSED: [&str; 8] =
    ["dymola", "simulationx", "amesim", "gt-suite", "maplesim", "simpack", "carmaker", "wolfram systemmodeler"];

/// Part of the message of the dynamic linker if a file cannot be mapped as executable.
const NOT_MAPPED: &str = "failed to map segment";

impl Runner {
    /// The findings of a first run, or the reason why the FMU is not at fault.
    pub(super) fn excused(&self, check: &Check, conditions: &Conditions, mut found: Conclusion) -> Conclusion {
        let why = match &found.verdict {
            Verdict::Violated(evidence) => evidence.join("; "),
            Verdict::NotDetermined(why) => why.clone(),
            Verdict::Pass(_) | Verdict::NotApplicable(_) => return found,
        };
        // A hang has no such cause, and another would cost the same time again.
        if why == OUT_OF_TIME || why.contains("did not return") || why.contains("too slow") {
            return found;
        }
        let excuse = self.unlicensed(&why).or_else(|| self.limited(check, conditions, &why, &mut found));
        let excuse = excuse.or_else(|| why.contains(NOT_MAPPED).then(|| self.elsewhere(conditions, &why)).flatten());
        excuse.map_or(found, |why| Verdict::NotDetermined(why).into())
    }

    /// A limit is the cause if the run succeeds without it. If the run then takes four times the limit, the evidence says so.
    fn limited(&self, check: &Check, conditions: &Conditions, why: &str, found: &mut Conclusion) -> Option<String> {
        let limit = conditions.allowance.memory;
        if limit == 0 {
            return None;
        }
        let (gib, files) = ((limit >> 30).max(1), limits::PROCESS_FILES);
        let most = 4 * limit;
        let resident = most.min(free());
        let run = |memory: u64| {
            let mut other = conditions.clone();
            other.allowance.memory = memory;
            other.resident = Some(resident);
            self.attempt(check, &other).verdict
        };
        match run(0) {
            Verdict::Pass(_) => {}
            Verdict::NotDetermined(end) if end == OUT_OF_MEMORY && resident < most => {
                return Some(format!(
                    "with the limit of {gib} GiB of address space, {why}; without it, the run took {} MiB, three quarters of \
                     the memory that is free on this computer",
                    resident >> 20
                ));
            }
            Verdict::NotDetermined(end) if end == OUT_OF_MEMORY => {
                if let Verdict::Violated(evidence) = &mut found.verdict {
                    evidence.push(format!(
                        "that run had a limit of {gib} GiB of address space; without it, the run took more than {} GiB of memory",
                        4 * gib
                    ));
                }
                return None;
            }
            _ => return None,
        }
        Some(if matches!(run(most), Verdict::Pass(_)) {
            format!(
                "with the limit of {gib} GiB of address space, {why}; with more, this run succeeds: use --memory {}",
                4 * gib
            )
        } else {
            format!(
                "with the limits of {gib} GiB of address space and {files} open files, {why}; without them, this run succeeds: use \
                 --memory 0"
            )
        })
    }

    /// A license is missing: the FMU reports it, or the FMU comes from a tool that requires licenses and refuses without a
    /// reason.
    fn unlicensed(&self, why: &str) -> Option<String> {
        let text = why.to_lowercase();
        if ["license", "licence", "licensing", "dongle"].iter().any(|word| text.contains(word)) {
            return Some(format!("a license of this FMU is missing on this computer: {why}"));
        }
        let tool = self.tool.as_deref()?;
        let needs = LICENSED.iter().any(|name| tool.to_lowercase().contains(name));
        (needs && why.contains("returned NULL") && !why.contains(SAID))
            .then(|| format!("{why} without a message; FMUs of {tool} may need a license on this computer"))
    }

    /// The temporary folder is the cause if the binary loads from a different folder.
    fn elsewhere(&self, conditions: &Conditions, why: &str) -> Option<String> {
        let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == "B00")?;
        let temporary = env::temp_dir();
        let others = [Some(PathBuf::from("/var/tmp")), env::home_dir(), env::current_dir().ok()];
        others.into_iter().flatten().filter(|folder| *folder != temporary).find_map(|folder| {
            let copy = tempfile::Builder::new().prefix(Folder::PROBE).tempdir_in(&folder).ok()?;
            let mut moved = conditions.clone();
            (moved.allowance.memory, moved.resident) = (0, Some(free()));
            moved.dir = copy.path().into();
            moved.binary = copy_binary(conditions, copy.path()).ok()??;
            let loads = matches!(self.attempt(check, &moved).verdict, Verdict::Pass(_));
            loads.then(|| {
                let (temporary, folder) = (temporary.display(), folder.display());
                format!(
                    "{why}; it loads from {folder}: the temporary folder {temporary} does not let programs run (noexec); set \
                     TMPDIR={folder}"
                )
            })
        })
    }
}

/// Memory in bytes that a run may take without disturbing the computer: three quarters of what is free.
fn free() -> u64 {
    kernel_size("meminfo", "MemAvailable:").map_or(u64::MAX, |bytes| bytes / 4 * 3)
}

/// Copies the description, and the binary with the files beside it; returns the path of the binary.
fn copy_binary(conditions: &Conditions, to: &Path) -> io::Result<Option<PathBuf>> {
    const DESCRIPTION: &str = "modelDescription.xml";
    fs::copy(conditions.dir.join(DESCRIPTION), to.join(DESCRIPTION))?;
    let Some((folder, relative)) = conditions.binary.parent().zip(conditions.binary.strip_prefix(&conditions.dir).ok())
    else {
        return Ok(None);
    };
    let binary = to.join(relative);
    let target = binary.parent().unwrap_or(to);
    fs::create_dir_all(target)?;
    for entry in fs::read_dir(folder)?.flatten().filter(|entry| entry.path().is_file()) {
        fs::copy(entry.path(), target.join(entry.file_name()))?;
    }
    Ok(Some(binary))
}
