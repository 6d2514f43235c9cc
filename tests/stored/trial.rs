//! States stored as bytes, restored and run.

use fmu_core::{Block, Capabilities, Fault, Plain, Stored};
use fmu_export::instance::Instance;
use fmu_export::lifecycle::{Next, Standard, State};
use fmu_export::log::{Log, Sink, Status};
use fmu_export::snapshot::Snapshot;
use fmu_export::{blob, registry};
use std::cell::Cell;
use std::mem::MaybeUninit;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;
use std::time::{Duration, Instant};

/// Step in s.
const H: f64 = 1e-4;
struct Silent;

impl Sink for Silent {
    fn write(&self, _: Status, _: &str, _: &str) {}

    fn hears(&self) -> bool {
        false
    }
}

pub(crate) fn instance<M: Stored>(current: Snapshot<M>) -> Instance<Plain<M>> {
    Instance::new(Standard::Fmi3, "stored".into(), Log::new(Box::new(Silent), false), current)
}

/// The bytes of an instance.
pub(crate) fn written<M: Stored>(instance: &Instance<Plain<M>>) -> Vec<u8> {
    blob::write(&instance.current, &Capabilities::NONE.stored.unwrap()).unwrap()
}

/// The state in these bytes.
pub(crate) fn read<M: Stored>(bytes: &[u8]) -> Result<Snapshot<M>, Fault> {
    blob::read(bytes, &Capabilities::NONE.stored.unwrap())
}

/// Sets the variable `name`, if it exists.
pub(crate) fn put<M: Stored>(current: &mut Snapshot<M>, name: &str, value: f64) {
    let index = (0..M::TABLE.len()).find(|&i| M::TABLE.locate(i).is_some_and(|(n, ..)| n == name));
    if let Some((_, fmu_core::Slot::Real(x))) = index.and_then(|i| M::TABLE.entry(&mut current.block, i)) {
        *x = value;
    }
}

/// Ends initialization as the gate would.
pub(crate) fn exit<M: Stored>(instance: &mut Instance<Plain<M>>) -> bool {
    let done = instance.exit_initialization().is_ok();
    instance.current.life.after(done, Next::Start);
    done
}

/// Bytes of a block in every state of its life.
pub(crate) fn seeds<M: Stored>(block: Block<M>) -> Vec<Vec<u8>> {
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

thread_local! {
    /// A panic of the model is in progress that the gate would turn into an error.
    static QUIET: Cell<bool> = const { Cell::new(false) };
}

/// Panics of the models, which the gate turns into errors, stay quiet.
pub(crate) fn quiet() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let hook = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !QUIET.get() {
                hook(info);
            }
        }));
    });
}

/// Restores the bytes; returns whether they were accepted, and the duration of the longest step.
pub(crate) fn trial<M: Stored>(bytes: &[u8]) -> Option<Duration> {
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
