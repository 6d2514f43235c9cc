//! Stored states of our models with random damage under a checksum that is right: refused, or a state that can be run.
//!
//! 1e5 trials; `FMU_BLOBS=1000000 cargo test --release --test stored` for more, `FMU_SEED=n` for others.
#![allow(missing_docs)]

use drive::estimator::Kind;
use drive::{MappedDrive, PmsmDrive, PmsmDriveMean, PmsmPlant, SensorlessController};
use drive_study::runner;
use fmu_core::draw::Draw;
use fmu_core::{Block, Capabilities, Fault, Plain, Stored};
use fmu_export::instance::Instance;
use fmu_export::lifecycle::{Next, Standard, State};
use fmu_export::log::{Log, Sink, Status};
use fmu_export::snapshot::Snapshot;
use fmu_export::{blob, registry};
use std::cell::Cell;
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};

/// Step in s.
const H: f64 = 1e-4;
/// Bytes before the content, and the part of them that is the same in every state of a model.
const HEADER: usize = 32;
/// Maximum duration of a trial on any machine. A step of our models has at most 1e7 substeps and so takes seconds.
const PATIENCE: Duration = Duration::from_mins(1);

struct Silent;

impl Sink for Silent {
    fn write(&self, _: Status, _: &str, _: &str) {}

    fn hears(&self) -> bool {
        false
    }
}

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

fn instance<M: Stored>(current: Snapshot<M>) -> Instance<Plain<M>> {
    Instance::new(Standard::Fmi3, "stored".into(), Log::new(Box::new(Silent), false), current)
}

/// The bytes of an instance.
fn written<M: Stored>(instance: &Instance<Plain<M>>) -> Vec<u8> {
    blob::write(&instance.current, &Capabilities::NONE.stored.unwrap()).unwrap()
}

/// The state in these bytes.
fn read<M: Stored>(bytes: &[u8]) -> Result<Snapshot<M>, Fault> {
    blob::read(bytes, &Capabilities::NONE.stored.unwrap())
}

/// Sets the variable `name`, if it exists.
fn put<M: Stored>(current: &mut Snapshot<M>, name: &str, value: f64) {
    let index = (0..M::TABLE.len()).find(|&i| M::TABLE.locate(i).is_some_and(|(n, ..)| n == name));
    if let Some((_, fmu_core::Slot::Real(x))) = index.and_then(|i| M::TABLE.entry(&mut current.block, i)) {
        *x = value;
    }
}

/// Ends initialization as the gate would.
fn exit<M: Stored>(instance: &mut Instance<Plain<M>>) -> bool {
    let done = instance.exit_initialization().is_ok();
    instance.current.life.after(done, Next::Start);
    done
}

/// Bytes of a block in every state of its life.
fn seeds<M: Stored>(block: Block<M>) -> Vec<Vec<u8>> {
    let mut instance = instance(Snapshot { block, ..Snapshot::default() });
    let mut seeds = vec![written(&instance)];
    instance.set_up(0.5, Some(1e3)).unwrap();
    instance.current.life.after(true, Next::To(State::Initialization));
    seeds.push(written(&instance));
    assert!(exit(&mut instance));
    for k in 0..400 {
        if [0, 1, 30].contains(&k) {
            seeds.push(written(&instance));
        }
        for (name, value) in [("u_a", 20.0), ("u_b", -5.0), ("i_a", 1.0), ("i_b", -2.0), ("u_dc", 540.0)] {
            put(&mut instance.current, name, value);
        }
        put(&mut instance.current, "speed_ref", 50.0);
        instance.do_step(instance.current.end, H).unwrap();
    }
    seeds.push(written(&instance));
    instance.current.life.after(true, Next::To(State::Terminated));
    seeds.push(written(&instance));
    seeds
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

/// Restores the bytes; returns whether they were accepted, and the duration of the longest step.
fn trial<M: Stored>(bytes: &[u8]) -> Option<Duration> {
    let mut instance = instance::<M>(Snapshot::default());
    let before = written(&instance);
    let handle = instance.deserialize(bytes);
    assert!(written(&instance) == before, "the instance changed");
    let handle = handle.ok()?;
    // A state of an instance for another interface is refused here.
    let restored = instance.restore(handle);
    registry::free::<M>(handle).unwrap();
    restored.ok()?;
    assert!(read::<M>(&written(&instance)).is_ok(), "a state that was taken is one that can be stored");
    let references: Vec<u32> = (1..=u32::try_from(M::TABLE.len()).unwrap())
        .filter(|&r| {
            let row = M::TABLE.locate(r as usize - 1);
            row.is_some_and(|(_, meta, element)| matches!(meta.kind, fmu_core::Kind::Real(_)) && element == 0)
        })
        .collect();
    let mut longest = Duration::ZERO;
    // As at the gate: a panic is an error, after which no step is made.
    QUIET.set(true);
    let _ = catch_unwind(AssertUnwindSafe(|| {
        if instance.current.life.state() == State::Instantiated && instance.set_up(0.0, None).is_ok() {
            instance.current.life.after(true, Next::To(State::Initialization));
        }
        if instance.current.life.state() == State::Initialization && !exit(&mut instance) {
            return;
        }
        for _ in 0..3 {
            let mut values = vec![MaybeUninit::uninit(); references.len()];
            let _ = instance.get::<f64>(&references, &mut values);
            if instance.current.life.state() != State::Step {
                return;
            }
            let began = Instant::now();
            let done = instance.do_step(instance.current.end, H);
            longest = longest.max(began.elapsed());
            if done.is_err() {
                return;
            }
        }
    }));
    QUIET.set(false);
    Some(longest)
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

thread_local! {
    /// A panic of the model is in progress that the gate would turn into an error.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// The number of trials for one model; and panics of the models stay quiet.
fn trials() -> u64 {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                hook(info);
            }
        }));
    });
    asked("FMU_BLOBS", 100_000).div_ceil(3)
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
