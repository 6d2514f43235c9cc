//! Several instances, threads, copies, loading and unloading.

use super::bench::{Bench, Blocked};
use super::it::It;
use super::lifecycle::difference;
use super::{Check, Levels, Run};
use fmu_import::raw::Raw;

const ONCE: &str = "2.0.5, 2.1.1 and 4.3.1; 3.0.2, 2.2.1 and 2.4.5";

#[rustfmt::skip]
pub(super) const CHECKS: &[Check] = &[
    Check { id: "L04a", requirement: "Instances that take turns do what each does alone, bit for bit.", clause: ONCE, levels: Levels::MUST, run: Run::Probe(turns) },
    Check { id: "L04b", requirement: "Instances in several threads do what each does alone, bit for bit.", clause: ONCE, levels: Levels::MUST, run: Run::Probe(threads) },
    Check { id: "L04c", requirement: "An instance can be made in one thread, used in another and freed in a third.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(travelling) },
    Check { id: "B05d", requirement: "Two copies of the binary, loaded with their symbols visible to each other, do not mix.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(copies) },
    Check { id: "B07a", requirement: "Instances that are made and freed leave no memory behind.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(leaks) },
    Check { id: "B07b", requirement: "The binary can be loaded and unloaded again and again, and is gone after that.", clause: "hardening", levels: Levels::HARD, run: Run::Probe(reloads) },
];

/// Inputs that move, so that instances do something.
pub(super) fn life(it: &It<'_>, n: u32) -> Result<Vec<Vec<Vec<u64>>>, Blocked> {
    let watched = it.bench.watched();
    (0..n)
        .map(|k| {
            it.excite(k)?;
            it.steps(1, it.bench.h())?;
            it.snapshot(&watched)
        })
        .collect()
}

fn once(bench: &Bench) -> bool {
    bench.flag("canBeInstantiatedOnlyOncePerProcess")
}

const ONLY_ONCE: &str = "canBeInstantiatedOnlyOncePerProcess is true";

fn turns(bench: &Bench) -> Result<(), Blocked> {
    if once(bench) {
        return bench.not_applicable(ONLY_ONCE);
    }
    let alone = life(&bench.stepping()?, 20)?;
    // That they can be made at all is what is asked here.
    let mut all = Vec::new();
    for k in 0..8 {
        let Some(it) = bench.instantiate(&bench.arguments(&format!("probe {k}")))? else {
            bench.violated(format!("instance {} beside {k} others could not be made", k + 2));
            return Ok(());
        };
        it.enter()?;
        it.exit()?;
        all.push((it, Vec::new()));
    }
    for k in 0..20 {
        for (it, rows) in &mut all {
            it.excite(k)?;
            it.steps(1, bench.h())?;
            rows.push(it.snapshot(&bench.watched())?);
        }
    }
    for (k, (it, rows)) in all.into_iter().enumerate() {
        if let Some((step, i)) = difference(&alone, &rows) {
            bench.violated(format!("instance {k}: {} differs after {} steps", bench.watched()[i].name, step + 1));
        }
        it.free()?;
    }
    Ok(())
}

/// A bench has files that only one thread may write; each thread gets a loaded binary and a silent journal of its own.
fn threads(bench: &Bench) -> Result<(), Blocked> {
    if once(bench) {
        return bench.not_applicable(ONLY_ONCE);
    }
    let alone = life(&bench.stepping()?, 40)?;
    bench.calling("4 threads, each with an instance, 40 steps");
    let results: Vec<Result<Vec<Vec<Vec<u64>>>, String>> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..4)
            .map(|k| {
                let twin = bench.twin(k);
                scope.spawn(move || twin.and_then(|twin| life(&twin.stepping()?, 40)).map_err(|Blocked(why)| why))
            })
            .collect();
        workers.into_iter().map(|w| w.join().unwrap_or_else(|_| Err("the thread died".into()))).collect()
    });
    for (k, rows) in results.into_iter().enumerate() {
        match rows {
            Err(why) => bench.violated(format!("thread {k}: {why}")),
            Ok(rows) => {
                if let Some((step, i)) = difference(&alone, &rows) {
                    bench.violated(format!("thread {k}: {} differs after {} steps", bench.watched()[i].name, step + 1));
                }
            }
        }
    }
    Ok(())
}

fn travelling(bench: &Bench) -> Result<(), Blocked> {
    let handle = bench.stepping()?.handle;
    let (start, h, raw) = (bench.start(), bench.h(), &bench.raw);
    bench.calling("DoStep in another thread");
    let stepped = std::thread::scope(|scope| {
        scope.spawn(move || raw.do_step(handle, start, h, false, [true; 4]).map(|(s, _)| s)).join()
    });
    let status = stepped.ok().flatten();
    bench.require(status.is_some_and(super::bench::fine), || format!("DoStep in another thread returned {status:?}"));
    bench.calling("FreeInstance in a third thread");
    let _ = std::thread::scope(|scope| scope.spawn(move || raw.free(handle)).join());
    Ok(())
}

#[cfg(not(unix))]
fn copies(bench: &Bench) -> Result<(), Blocked> {
    bench.not_applicable("symbols are not visible to each other on this system")
}

#[cfg(unix)]
fn copies(bench: &Bench) -> Result<(), Blocked> {
    if once(bench) {
        return bench.not_applicable(ONLY_ONCE);
    }
    let alone = life(&bench.stepping()?, 20)?;
    let folder = bench.binary.parent().ok_or_else(|| Blocked("the binary has no folder".into()))?;
    let failed = |e: std::io::Error| Blocked(e.to_string());
    let mut twins = Vec::new();
    for k in 0..2 {
        // Below the working directory of the probe, which is thrown away.
        let target = std::env::current_dir().map_err(failed)?.join(format!("copy {k} %23 \u{e4}"));
        std::fs::create_dir_all(&target).map_err(failed)?;
        for file in std::fs::read_dir(folder).map_err(failed)?.flatten() {
            if file.path().is_file() {
                std::fs::copy(file.path(), target.join(file.file_name())).map_err(failed)?;
            }
        }
        let binary = target.join(bench.binary.file_name().unwrap_or_default());
        bench.calling("dlopen(RTLD_NOW | RTLD_GLOBAL)");
        let raw = Raw::open_global(&binary, bench.md.version).map_err(Blocked)?;
        twins.push(bench.twin_of(raw, 10 + k)?);
    }
    let instances: Vec<It<'_>> = twins.iter().map(Bench::stepping).collect::<Result<_, _>>()?;
    let mut rows = vec![Vec::new(); instances.len()];
    for k in 0..20 {
        for (it, rows) in instances.iter().zip(&mut rows) {
            it.excite(k)?;
            it.steps(1, bench.h())?;
            rows.push(it.snapshot(&bench.watched())?);
        }
    }
    for rows in rows {
        if let Some((step, i)) = difference(&alone, &rows) {
            bench.violated(format!("a copy: {} differs after {} steps", bench.watched()[i].name, step + 1));
        }
    }
    drop(instances);
    // Two copies stay loaded until the process ends.
    twins.into_iter().for_each(std::mem::forget);
    Ok(())
}

/// Resident memory of this process, in bytes.
fn resident() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmRSS:"))?;
    line.split_whitespace().nth(1)?.parse::<u64>().ok().map(|kib| kib * 1024)
}

fn leaks(bench: &Bench) -> Result<(), Blocked> {
    if resident().is_none() {
        return Err(Blocked("this system does not tell the memory of a process".into()));
    }
    let cycle = |n: usize| {
        bench.many(&format!("{n} instances, made, stepped and freed"), || {
            for _ in 0..n {
                let Some(it) = bench.instantiate(&bench.arguments("probe"))? else {
                    return Err(Blocked("no instance".into()));
                };
                it.enter()?;
                it.exit()?;
                it.steps(2, bench.h())?;
                it.free()?;
                if bench.late() {
                    break;
                }
            }
            Ok(())
        })
    };
    cycle(50)?;
    let before = resident().unwrap_or(0);
    cycle(300)?;
    let after = resident().unwrap_or(0);
    let grown = after.saturating_sub(before);
    // One page an instance would be 1.2 MB; the struct of callbacks that we keep for FMI 2.0 is 40 bytes.
    bench.require(grown < 1_000_000, || format!("300 instances left {} kB behind", grown / 1000));
    bench.note(format!("{} kB more after 300 instances", grown / 1000));
    Ok(())
}

fn reloads(bench: &Bench) -> Result<(), Blocked> {
    let name = bench.binary.file_name().unwrap_or_default();
    // Another path, so that what the bench has loaded does not keep it.
    let home = std::env::current_dir().map_err(|e| Blocked(e.to_string()))?;
    let target = home.join("reloaded");
    let folder = bench.binary.parent().unwrap_or(&home);
    std::fs::create_dir_all(&target).map_err(|e| Blocked(e.to_string()))?;
    for file in std::fs::read_dir(folder).into_iter().flatten().flatten().filter(|f| f.path().is_file()) {
        std::fs::copy(file.path(), target.join(file.file_name())).map_err(|e| Blocked(e.to_string()))?;
    }
    let binary = target.join(name);
    for k in 0..20 {
        bench.calling(&format!("loading the binary for the time {}", k + 1));
        let raw = Raw::open(&binary, bench.md.version).map_err(Blocked)?;
        let twin = bench.twin_of(raw, 20 + k)?;
        {
            let it = twin.stepping()?;
            it.steps(3, bench.h())?;
            it.free()?;
        }
        bench.calling(&format!("unloading the binary for the time {}", k + 1));
        twin.raw.close().map_err(Blocked)?;
        if bench.late() {
            break;
        }
    }
    if let Ok(maps) = std::fs::read_to_string("/proc/self/maps") {
        let text = binary.to_string_lossy();
        bench.require(!maps.lines().any(|l| l.ends_with(&*text)), || {
            "the binary is still loaded after it was unloaded".into()
        });
    }
    Ok(())
}
