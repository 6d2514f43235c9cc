//! A first run that fails may fail because of a limit of the checker or because of this computer. It is tried again without the
//! limit on memory, and from another folder if the binary does not load: where it then succeeds, the FMU is not at fault.

use crate::check::{Check, Conclusion, Verdict};
use crate::checks::GROUPS;
use crate::runner::{Conditions, OUT_OF_TIME, Runner};
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Part of the message of the dynamic linker if a file cannot be mapped as executable.
const NOT_MAPPED: &str = "failed to map segment";

impl Runner {
    /// The findings of a first run, or the reason why the FMU is not at fault.
    pub(super) fn excused(&self, check: &Check, conditions: &Conditions, found: Conclusion) -> Conclusion {
        let why = match &found.verdict {
            Verdict::Violated(evidence) => evidence.first().cloned().unwrap_or_default(),
            Verdict::NotDetermined(why) => why.clone(),
            Verdict::Pass(_) | Verdict::NotApplicable(_) => return found,
        };
        // A hang has no such cause, and another one would take as long again.
        if why == OUT_OF_TIME || why.contains("did not return") || why.contains("too slow") {
            return found;
        }
        let excuse = self.limited(check, conditions, &why);
        let excuse = excuse.or_else(|| why.contains(NOT_MAPPED).then(|| self.elsewhere(conditions, &why)).flatten());
        excuse.map_or(found, |why| Verdict::NotDetermined(why).into())
    }

    /// The limit on memory is the cause if the run succeeds without it.
    fn limited(&self, check: &Check, conditions: &Conditions, why: &str) -> Option<String> {
        let limit = conditions.allowance.memory;
        if limit == 0 {
            return None;
        }
        let mut unlimited = conditions.clone();
        unlimited.allowance.memory = 0;
        let found = self.attempt(check, &unlimited);
        let gib = limit >> 30;
        matches!(found.verdict, Verdict::Pass(_)).then(|| {
            format!(
                "with the limit of {gib} GiB of address space, {why}; without it, this run succeeds: use --memory {}, or \
                 --memory 0 for no limit",
                4 * gib.max(1)
            )
        })
    }

    /// The temporary folder is the cause if the binary loads from another one.
    fn elsewhere(&self, conditions: &Conditions, why: &str) -> Option<String> {
        let check = GROUPS.iter().flat_map(|g| g.checks).find(|c| c.id == "B00")?;
        let temporary = env::temp_dir();
        let others = [Some(PathBuf::from("/var/tmp")), env::home_dir(), env::current_dir().ok()];
        others.into_iter().flatten().filter(|folder| *folder != temporary).find_map(|folder| {
            let copy = tempfile::Builder::new().prefix("fmu-probe-").tempdir_in(&folder).ok()?;
            let mut moved = conditions.clone();
            moved.allowance.memory = 0;
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
