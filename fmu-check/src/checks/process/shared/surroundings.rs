//! State that an FMU must leave unchanged: settings of the process, the folder of the FMU, and everything that outlives a run.

use crate::checks::process::shared::copies::{Files, MANY, failed, list, second_binary};
use crate::session::{NotDetermined, Session};
use fmu_import::raw::{armed_timers, locale};
use fmu_import::{Folder, guard, limits};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};

/// Loads a copy of the binary, runs it, unloads it, and returns the results of `look` before and after.
fn around<T>(session: &Session, look: &dyn Fn() -> T) -> Result<(T, T), NotDetermined> {
    let binary = second_binary(session, "guest")?;
    // The first loading may have left it already.
    std::env::set_current_dir(&session.home).map_err(|e| failed(&e))?;
    let before = look();
    session.record_call("loading, a complete run, unloading");
    {
        let duplicate = session.duplicate(&binary, 62)?;
        duplicate.complete_run()?;
    }
    let after = look();
    Ok((before, after))
}

/// A set of signals, as the kernel writes it, without 32 and 33: the C library uses them for its threads, and programs cannot.
fn without_those_of_the_library(signals: &str) -> String {
    u64::from_str_radix(signals, 16).map_or(signals.into(), |set| format!("{:016x}", set & !(3 << 31)))
}

/// The settings of this process, by name.
fn current_settings() -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    let mut put = |name: &str, value: String| drop(all.insert(name.to_owned(), value));
    let here = std::env::current_dir().map(|path| path.display().to_string());
    put("the working directory", here.unwrap_or_default());
    put("the locale", locale().unwrap_or_default());
    put("the interval timers", armed_timers().unwrap_or_default().join(", "));
    put("the timers", fs::read_to_string("/proc/self/timers").unwrap_or_default());
    for (name, value) in std::env::vars_os() {
        put(&format!("the environment variable {}", name.to_string_lossy()), value.to_string_lossy().into_owned());
    }
    let fields = ["Umask", "SigIgn", "SigCgt", "SigBlk", "Cpus_allowed_list", "NoNewPrivs"];
    for line in fs::read_to_string("/proc/self/status").unwrap_or_default().lines() {
        if let Some((name, value)) = line.split_once(':').filter(|(name, _)| fields.contains(name)) {
            put(
                name,
                if name.starts_with("Sig") { without_those_of_the_library(value.trim()) } else { value.trim().into() },
            );
        }
    }
    // The program name is in parentheses and may contain any character.
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let words: Vec<&str> = stat.rsplit_once(')').map_or("", |(_, rest)| rest).split_whitespace().collect();
    for (name, at) in [("the priority", 15), ("the nice value", 16), ("the scheduling policy", 38)] {
        put(name, words.get(at).copied().unwrap_or_default().into());
    }
    for line in fs::read_to_string("/proc/self/limits").unwrap_or_default().lines().skip(1) {
        let name = line.get(..26).unwrap_or_default().trim().to_owned();
        put(
            &format!("the limit \u{22}{name}\u{22}"),
            line.get(26..).unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" "),
        );
    }
    all
}

pub(crate) fn settings(session: &Session) -> Result<(), NotDetermined> {
    let (before, after) = around(session, &current_settings)?;
    let names: Vec<&String> = before.keys().chain(after.keys().filter(|name| !before.contains_key(*name))).collect();
    for name in names {
        let [old, new] = [&before, &after].map(|all| all.get(name).map_or("nothing", String::as_str));
        session.require(old == new, || format!("after a complete run: {name} changed from {old:?} to {new:?}"));
    }
    Ok(())
}

pub(crate) fn written(session: &Session) -> Result<(), NotDetermined> {
    let (before, after) = around(session, &|| list(&session.dir))?;
    let (Some(before), Some(after)) = (before, after) else {
        return Err(NotDetermined(format!(
            "not tried: more than {MANY} files, or files of {} bytes",
            limits::PROBE_FILE
        )));
    };
    let missing =
        |from: &Files, all: &Files| from.iter().filter(|f| !all.contains(f)).map(|f| f.0.clone()).collect::<Vec<_>>();
    for path in missing(&after, &before) {
        session.violated(format!("after a complete run: {} was written", path.display()));
    }
    for path in missing(&before, &after).into_iter().filter(|path| !path.exists()) {
        session.violated(format!("after a complete run: {} was removed", path.display()));
    }
    Ok(())
}

/// Remains after a run: the number of threads, and other resources.
fn remaining() -> (usize, Vec<String>) {
    let links = fs::read_dir("/proc/self/fd").into_iter().flatten().flatten();
    // Reading the folder opens it, under a name that changes.
    let open = links.filter_map(|e| fs::read_link(e.path()).ok()).filter(|p| !p.ends_with("fd"));
    let mut counted = BTreeMap::new();
    open.for_each(|path| *counted.entry(path).or_insert(0) += 1);
    // Each with its number: the same file may be open many times.
    let each = |(path, n): (PathBuf, usize)| (1..=n).map(move |k| format!("{} is open ({k})", path.display()));
    let mut all: Vec<String> = counted.into_iter().flat_map(each).collect();
    all.extend(guard::children().into_iter().map(|child| format!("the process {child} was left behind")));
    (fs::read_dir("/proc/self/task").map_or(0, Iterator::count), all)
}

/// The contents of shared and user folders, with the time of its last change, without the folders of the checker's own probes, which
/// come and go meanwhile. The number of this process is removed from names.
fn stray_files() -> Vec<(String, Option<SystemTime>)> {
    let folders = [Some(PathBuf::from("/dev/shm")), Some(std::env::temp_dir()), std::env::home_dir()];
    let own = std::process::id().to_string();
    let entries =
        folders.into_iter().flatten().filter(|f| f.parent().is_some()).filter_map(|f| fs::read_dir(f).ok()).flatten();
    entries
        .flatten()
        .filter(|e| !e.file_name().to_string_lossy().starts_with(Folder::PROBE))
        .filter_map(|e| Some((e.path().display().to_string().replace(&own, "PID"), e.metadata().ok()?.modified().ok())))
        .collect()
}

pub(crate) fn left_behind(session: &Session) -> Result<(), NotDetermined> {
    let look = || (remaining(), stray_files());
    let (((threads, before), files), (mut after, written)) = around(session, &look)?;
    // A thread may take a while to end, especially on a busy machine.
    for _ in 0..200 {
        if after.0 <= threads && after.1.iter().all(|what| before.contains(what)) {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
        after = remaining();
    }
    session.require(after.0 <= threads, || {
        format!("after a complete run: the number of threads changed from {threads} to {}", after.0)
    });
    for what in after.1.iter().filter(|what| !before.contains(what)) {
        session.violated(format!("after a complete run: {what}"));
    }
    let new = |before: &[(String, _)], after: Vec<(String, _)>| {
        after.into_iter().filter(|f| !before.contains(f)).map(|f| f.0).collect::<Vec<_>>()
    };
    let first = new(&files, written);
    if !first.is_empty() {
        // Other programs write there too, but not the same files in a second run.
        let (before, after) = around(session, &stray_files)?;
        for path in new(&before, after).into_iter().filter(|path| first.contains(path)) {
            session.violated(format!("after a complete run: the file {path} was left behind"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn signals_of_the_c_library_are_no_setting() {
        let own = super::without_those_of_the_library;
        assert_eq!(
            own("0000000100000440"),
            own("0000000000000440"),
            "SIGSETXID, which glibc catches once there are threads"
        );
        assert_ne!(own("0000000001000440"), own("0000000000000440"), "SIGXFSZ");
        assert_eq!(own("no number"), "no number");
    }
}
