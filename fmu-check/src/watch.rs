//! Distinguishes a call that hangs from a slow probe: by its progress and by the processor time it uses, not by the clock alone,
//! so a busy machine causes no finding.

use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A probe that makes progress is abandoned after this many time limits.
const PATIENCE: u32 = 6;

/// The parent's data about a probe that has not ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pace {
    /// Go on waiting.
    Runs,
    /// One call has used the processor for the time limit, or has slept for it.
    Hangs,
    /// One call has stopped the process (`SIGSTOP`) for the time limit: the checker never stops a probe, and a terminal cannot
    /// stop it either, because it has its own session.
    #[cfg_attr(not(target_os = "linux"), allow(dead_code, reason = "read on Linux only"))]
    Stopped,
    /// It makes progress, or gets no processor time: neither indicates a fault.
    Slow,
}

/// Watches one process.
pub(super) struct Watch {
    pid: u32,
    /// The file in which it records its present call.
    journal: PathBuf,
    limit: Duration,
    /// Time since the watch began. Time in which this process itself was stopped or not scheduled does not count.
    watched: Duration,
    /// The call, since when, and the processor time then.
    call: (Vec<u8>, Duration, Option<Duration>),
    looked: Instant,
}

impl Watch {
    pub(super) fn new(pid: u32, journal: PathBuf, limit: Duration) -> Self {
        let zero = Duration::ZERO;
        Self { pid, journal, limit, watched: zero, call: (Vec::new(), zero, None), looked: Instant::now() }
    }

    /// Looks at the process; cheap enough to be called in a loop.
    pub(super) fn look(&mut self) -> Pace {
        let since = self.looked.elapsed();
        if since < self.limit / 100 {
            return Pace::Runs;
        }
        self.looked = Instant::now();
        self.watched += since.min(self.limit / 10);
        let (used, rests) = processor(self.pid).unzip();
        let call = fs::read(&self.journal).unwrap_or_default();
        if call != self.call.0 {
            self.call = (call, self.watched, used);
        }
        let over = self.watched > self.limit.saturating_mul(PATIENCE);
        if self.watched.saturating_sub(self.call.1) <= self.limit {
            return if over { Pace::Slow } else { Pace::Runs };
        }
        let Some((used, rests)) = used.zip(rests) else { return Pace::Hangs };
        let since = used.saturating_sub(self.call.2.unwrap_or_default());
        // Half of the limit: the processor's clock ticks in steps.
        match rests {
            _ if since > self.limit / 2 => Pace::Hangs,
            Some(how) if since < self.limit / 20 => how,
            _ if over => Pace::Slow,
            _ => Pace::Runs,
        }
    }
}

/// The processor time that a process has used, and the state of all its threads at rest: waiting, or stopped by a signal.
#[cfg(target_os = "linux")]
fn processor(pid: u32) -> Option<(Duration, Option<Pace>)> {
    // The program name is in parentheses and may contain any character.
    let fields =
        |text: String| Some(text.rsplit_once(')')?.1.split_whitespace().map(str::to_owned).collect::<Vec<_>>());
    let stat = fields(fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)?;
    // utime and stime; the kernel reports hundredths of a second on every known system.
    let ticks = stat.get(11)?.parse::<u64>().ok()? + stat.get(12)?.parse::<u64>().ok()?;
    let tasks = fs::read_dir(format!("/proc/{pid}/task")).ok()?.flatten();
    let state = |task: fs::DirEntry| fields(fs::read_to_string(task.path().join("stat")).ok()?)?.into_iter().next();
    let states: Vec<String> = tasks.filter_map(state).collect();
    let all = |state: &str| states.iter().all(|s| s == state);
    let rests = if all("S") { Some(Pace::Hangs) } else { all("T").then_some(Pace::Stopped) };
    Some((Duration::from_millis(10 * ticks), rests))
}

#[cfg(not(target_os = "linux"))]
fn processor(_: u32) -> Option<(Duration, Option<Pace>)> {
    None
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;
    use std::process::{Child, Command};

    /// The final verdict of the watch on a shell command, with its limit.
    fn end(script: &str, limit: u64, journal: &std::path::Path) -> Pace {
        let mut child: Child = Command::new("sh").args(["-c", script]).env("JOURNAL", journal).spawn().unwrap();
        let mut watch = Watch::new(child.id(), journal.into(), Duration::from_millis(limit));
        loop {
            let state = watch.look();
            if state != Pace::Runs || child.try_wait().unwrap().is_some() {
                let _ = child.kill();
                child.wait().unwrap();
                return state;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn a_hang_is_no_slow_probe() {
        let folder = tempfile::tempdir().unwrap();
        let journal = folder.path().join("call");
        // One call that computes without end, one that waits without end.
        // On a busy machine, it may get too little of the processor to tell: slow.
        let seen: Vec<Pace> =
            (0..4).map(|_| end("while :; do :; done", 400, &journal)).take_while(|&p| p != Pace::Hangs).collect();
        assert!(seen.len() < 4 && seen.iter().all(|&pace| pace == Pace::Slow), "{seen:?}");
        assert_eq!(end("exec sleep 60", 400, &journal), Pace::Hangs);
        // Call after call: slow, however long it takes. It appends, because a file that is truncated first may be seen empty
        // each time on a machine with a busy disk.
        let calls = "n=0; while :; do n=$((n + 1)); echo \"C call $n\" >> \"$JOURNAL\"; done";
        assert_eq!(end(calls, 400, &journal), Pace::Slow);
        // One call that stops the process.
        assert_eq!(end("kill -STOP $$", 400, &journal), Pace::Stopped);
        // One that ends is left to end.
        assert_eq!(end("true", 400, &journal), Pace::Runs);
    }

    /// The whole run may be stopped (a terminal, a debugger): the probe has not hung meanwhile.
    #[test]
    fn what_the_watch_has_slept_does_not_count() {
        let mut child = Command::new("sleep").arg("60").spawn().unwrap();
        let limit = Duration::from_millis(500);
        let mut watch = Watch::new(child.id(), "no journal".into(), limit);
        let seen = [1, 3, 3].map(|times| {
            std::thread::sleep(times * limit);
            watch.look()
        });
        let _ = child.kill();
        child.wait().unwrap();
        assert_eq!(seen, [Pace::Runs; 3]);
    }
}
