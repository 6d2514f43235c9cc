//! Stored states of our models with random damage under a checksum that is right: refused, or a state that can be run.
//!
//! 5e4 trials; `FMU_BLOBS=1000000 cargo test --release --test stored` for more, `FMU_SEED=n` for others.
#![allow(missing_docs)]

#[path = "stored/trial.rs"]
mod trial;

use drive::estimator::Kind;
use drive::{MappedDrive, PmsmDrive, PmsmDriveMean, PmsmPlant, SensorlessController};
use drive_study::runner;
use fmu_core::draw::Draw;
use fmu_core::{Block, Stored};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};
use trial::{quiet, read, seeds, trial};

/// Bytes before the content, and the part of them that is the same in every state of a model.
const HEADER: usize = 32;
/// Maximum duration of a trial on any machine. A step of our models has at most 1e7 substeps and so takes seconds.
const PATIENCE: Duration = Duration::from_mins(1);

/// A number from the environment.
fn asked(name: &str, otherwise: u64) -> u64 {
    let number = std::env::var(name).ok();
    number.map_or(otherwise, |text| text.parse().unwrap_or_else(|_| panic!("{name} = {text:?} is not a whole number")))
}

/// Watches the trials and ends the process with a message when one takes too long: a hang is also a finding.
fn watch(name: &'static str) -> Arc<AtomicU64> {
    let trial = Arc::new(AtomicU64::new(0));
    let seen = Arc::downgrade(&trial);
    std::thread::spawn(move || {
        let (mut last, mut since) = (0, Instant::now());
        while let Some(current) = seen.upgrade().map(|trial| trial.load(Relaxed)) {
            if current != last {
                (last, since) = (current, Instant::now());
            }
            if since.elapsed() > PATIENCE {
                eprintln!("{name}: trial {current} hangs");
                std::process::abort();
            }
            std::thread::sleep(Duration::from_millis(100));
        }
    });
    trial
}

/// Bytes with damage of one kind or several, and whether it shows without a look at the content: in the header, the
/// size or the checksum.
fn damaged(seeds: &[Vec<u8>], draw: &mut Draw) -> (Vec<u8>, bool) {
    const NUMBERS: [f64; 12] =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, 5e-324, 1e-300, 1e300, -1e300, 1e6, 1e-9, -1.0];
    let seed = &seeds[draw.below(seeds.len())];
    let body = seed.len() - 4;
    let length = u32::from_le_bytes(seed[28..HEADER].try_into().unwrap()) as usize;
    let mut bytes = seed[..body].to_vec();
    for _ in 0..draw.of(&[1, 1, 1, 2, 8]) {
        let at = HEADER + draw.below(length);
        match draw.below(10) {
            0..=2 => bytes[at] ^= 1 << draw.below(8),
            3 => bytes[at] = draw.of(&[0, 1, 2, 0x7f, 0x80, 0xff]),
            4 | 5 => {
                let number = draw.of(&NUMBERS).to_le_bytes();
                let end = body.min(at + 8);
                bytes[at..end].copy_from_slice(&number[..end - at]);
            }
            // The longest integers of the encoding.
            6 => bytes[at..body.min(at + 10)].fill(0xff),
            7 => {
                // The beginning of one and the remainder of another, not always at its offset.
                let other = &seeds[draw.below(seeds.len())];
                let from = HEADER + draw.below(length);
                let end = body.min(at + (other.len() - 4).saturating_sub(from));
                let from = if draw.below(2) == 0 { at.min(other.len() - 4) } else { from };
                let n = (end - at).min(other.len() - 4 - from);
                bytes[at..at + n].copy_from_slice(&other[from..from + n]);
            }
            8 => {
                // Cut short, or longer than the content.
                let new = u32::try_from(draw.below(body - HEADER + 1)).unwrap();
                bytes[28..HEADER].copy_from_slice(&new.to_le_bytes());
            }
            _ => {
                let at = draw.below(HEADER);
                bytes[at] ^= 1 << draw.below(8);
            }
        }
    }
    if draw.below(100) == 0 {
        bytes.truncate(draw.below(body));
    }
    let mut crc = flate2::Crc::new();
    crc.update(&bytes);
    let wrong_sum = draw.below(50) == 0;
    let shows = wrong_sum || bytes.len() < body || bytes[..HEADER - 4] != seed[..HEADER - 4];
    bytes.extend((crc.sum() ^ u32::from(wrong_sum)).to_le_bytes());
    (bytes, shows)
}

fn damage<M: Stored>(seeds: &[Vec<u8>], trials: u64) {
    let name = M::INFO.name;
    let (number, mut draw) = (watch(name), Draw(asked("FMU_SEED", 1)));
    let (mut taken, mut longest) = (0_u64, Duration::ZERO);
    for seed in seeds {
        assert!(read::<M>(seed).is_ok(), "a seed is whole");
    }
    for k in 0..trials {
        number.store(k, Relaxed);
        let (bytes, shows) = damaged(seeds, &mut draw);
        if let Some(time) = trial::<M>(&bytes) {
            assert!(!shows, "{name}: trial {k} was taken with a damaged header, size or checksum");
            taken += 1;
            longest = longest.max(time);
        }
    }
    println!("{name}: {trials} trials, {taken} taken, the longest step {longest:?}");
    assert!(taken > trials / 100, "{name}: hardly any damage was plausible, so the test is ineffective: {taken}");
    // Damage of an unconstrained number gives another valid state, so no particular share must be refused.
    assert!(longest < PATIENCE / 3, "{name}: a step of {longest:?}");
}

/// The number of trials for one model.
fn trials() -> u64 {
    quiet();
    asked("FMU_BLOBS", 50_000).div_ceil(3)
}

#[test]
fn plant() {
    damage::<PmsmPlant>(&seeds(Block::<PmsmPlant>::default()), trials());
}

#[test]
fn controller() {
    let each = Kind::ALL.iter().flat_map(|&kind| seeds(runner::drive(kind).controller));
    damage::<SensorlessController>(&each.collect::<Vec<_>>(), trials());
}

#[test]
fn mean() {
    damage::<PmsmDriveMean>(&seeds(Block::<PmsmDriveMean>::default()), trials());
}

#[test]
fn mapped() {
    damage::<MappedDrive>(&seeds(Block::<MappedDrive>::default()), trials());
}

#[test]
fn drive() {
    damage::<PmsmDrive>(&seeds(Block::<PmsmDrive>::default()), trials());
}
