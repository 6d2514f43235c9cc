//! Scheduled Execution: partitions, updates of clocks, locks.

use super::*;

#[test]
fn partitions_of_scheduled_execution() {
    let host = Host::started(Kind::Se);
    assert_eq!((host.set(U, 2.0), host.activate(FIXED, 0.0), host.get(Y)), (OK, OK, Some(0.0)));
    assert_eq!((host.set(U, 3.0), host.activate(FIXED, 0.2), host.get(Y)), (OK, OK, Some(2.0)));
    assert_eq!((host.ticks(), host.get(0), host.updates.get()), (2, Some(0.2), 0));
    // Another clock may be activated at an earlier time; each has its own.
    assert_eq!((host.activate(CONSTANT, 0.15), host.ticks()), (OK, 3));
    for (vr, t) in
        [(FIXED, 0.2), (FIXED, 0.1), (CONSTANT, -0.1), (CONSTANT, f64::NAN), (TRIP, 1.0), (U, 1.0), (99, 1.0)]
    {
        let host = Host::started(Kind::Se);
        assert_eq!(host.activate(FIXED, 0.2), OK);
        assert_eq!((host.activate(vr, t), host.get(Y).is_some()), (ERROR, true), "{vr} at {t}");
        assert_eq!(host.activate(FIXED, 9.0), ERROR, "Error is for all partitions");
    }
    // An interval of a changing clock follows its tick.
    assert_eq!((host.activate(CHANGING, 0.3), host.interval(CHANGING)), (OK, Some((0.2, 2))));
    assert_eq!((host.set_interval(TUNABLE, 0.4), host.interval(TUNABLE)), (OK, Some((0.4, 2))));
}

/// Ticks of output clocks, and times of countdowns, are reported by the callback, which reads each once.
#[test]
fn clock_updates_in_scheduled_execution() {
    let host = Host::started(Kind::Se);
    let heard = Rc::new(RefCell::new(Vec::new()));
    let list = heard.clone();
    *host.act.borrow_mut() = Some(Box::new(move |host| {
        let reported = (host.clock(TRIP), host.clock(TRIP), host.interval(COUNTDOWN), host.interval(COUNTDOWN));
        list.borrow_mut().push(reported);
    }));
    assert_eq!(host.activate(TRIGGERED, 1.0), OK);
    assert_eq!(host.activate(FIXED, 1.0), OK);
    assert_eq!(host.activate(TRIGGERED, 1.1), OK);
    assert_eq!(host.activate(COUNTDOWN, 1.35), OK);
    let changed = |x| (Some((x, 2)), Some((x, 1)));
    let (first, second) = (changed(0.25), changed(0.25));
    assert_eq!(
        *heard.borrow(),
        [(Some(false), Some(false), first.0, first.1), (Some(true), Some(false), second.0, second.1),]
    );
    assert_eq!((host.updates.get(), host.ticks()), (2, 4));
}

#[test]
fn what_a_callback_may_not_call() {
    type Refused = fn(&Host) -> bool;
    let refused: [(&str, Refused); 8] = [
        ("fmi3ActivateModelPartition", |h| h.activate(FIXED, 2.0) == OK),
        ("fmi3GetFloat64", |h| h.get(Y).is_some()),
        ("fmi3SetFloat64", |h| h.set(U, 1.0) == OK),
        ("fmi3SetIntervalDecimal", |h| h.set_interval(TUNABLE, 1.0) == OK),
        ("fmi3GetFMUState", |h| unsafe { fmi3GetFMUState(h.it.get(), &mut null_mut()) == OK }),
        ("fmi3Terminate", |h| unsafe { fmi3Terminate(h.it.get()) == OK }),
        ("fmi3Reset", |h| unsafe { fmi3Reset(h.it.get()) == OK }),
        ("fmi3GetIntervalDecimal", |h| h.interval(TUNABLE).is_some()),
    ];
    for (name, call) in refused {
        let host = Host::started(Kind::Se);
        *host.act.borrow_mut() = Some(Box::new(move |host| {
            assert!(!call(host), "{name}");
            unsafe { fmi3FreeInstance(host.it.get()) };
            assert_eq!(unsafe { fmi3Reset(host.it.get()) }, ERROR);
        }));
        assert_eq!(host.activate(TRIGGERED, 1.0), ERROR);
        assert!(host.errors()[0].contains(name), "{name}");
        assert_eq!(unsafe { fmi3Reset(host.it.get()) }, OK);
    }
}

#[test]
fn a_panic_in_a_tick_ends_one_instance() {
    for kind in [Kind::Cs, Kind::Me, Kind::Se] {
        let (host, other) = (Host::started(kind), Host::started(kind));
        assert_eq!(unsafe { fmi3SetBoolean(host.it.get(), &PANICS, 1, &Fmi3Boolean(1), 1) }, OK);
        let tick = |host: &Host| {
            if kind == Kind::Se {
                return host.activate(FIXED, 0.0);
            }
            assert_eq!(host.set_clock(FIXED, true), OK);
            host.update()
        };
        assert_eq!((tick(&host), tick(&other)), (ERROR, OK));
        assert!(host.errors()[0].contains("panics is set"));
        assert_eq!(other.ticks(), 1);
    }
}

/// The scheduler is locked around code that it could interrupt, never twice; two threads with a lock do not disturb each other.
pub(crate) mod preemption {
    use super::*;
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicI32, AtomicU32, Ordering::SeqCst};

    const ROUNDS: i32 = if cfg!(miri) { 20 } else { 1000 };

    static DEPTH: AtomicI32 = AtomicI32::new(0);
    static LOCKS: AtomicU32 = AtomicU32::new(0);

    /// A lock that a thread can acquire only once.
    extern "C" fn lock() {
        while DEPTH.compare_exchange(0, 1, SeqCst, SeqCst).is_err() {
            std::thread::yield_now();
        }
        LOCKS.fetch_add(1, SeqCst);
    }

    extern "C" fn unlock() {
        assert_eq!(DEPTH.swap(0, SeqCst), 1);
    }

    extern "C" fn update(environment: *mut c_void) {
        assert_eq!(DEPTH.load(SeqCst), 1);
        // The other thread must wait for the lock until this call is over.
        std::thread::sleep(std::time::Duration::from_micros(50));
        let it = unsafe { *environment.cast::<InstancePointer>() };
        let mut active = Fmi3Boolean(9);
        assert_eq!(unsafe { fmi3GetClock(it, &TRIP, 1, &mut active) }, OK);
    }

    #[derive(Clone, Copy)]
    struct Shared(InstancePointer);
    unsafe impl Send for Shared {}

    impl Shared {
        fn activate(self, vr: u32, t: f64) -> c_int {
            unsafe { fmi3ActivateModelPartition(self.0, vr, t) }
        }
    }

    /// An instance after its initialization, with or without the lock of a scheduler.
    fn started(it: &mut InstancePointer, locks: bool) -> Shared {
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let token = CString::new(This::TOKEN.as_str()).unwrap();
        let (name, token, no) = (c"kinds".as_ptr(), token.as_ptr(), Fmi3Boolean(0));
        let environment = (&raw mut *it).cast();
        let (lock, unlock) = (locks.then_some(lock as _), locks.then_some(unlock as _));
        let update: Option<unsafe extern "C" fn(*mut c_void)> = Some(if locks { update } else { silent });
        *it = unsafe {
            fmi3InstantiateScheduledExecution(name, token, null(), no, no, environment, None, update, lock, unlock)
        };
        unsafe {
            assert_eq!(fmi3EnterInitializationMode(*it, no, 0.0, 0.0, no, 0.0), OK);
            assert_eq!(fmi3ExitInitializationMode(*it), OK);
        }
        Shared(*it)
    }

    extern "C" fn silent(_: *mut c_void) {}

    /// Two threads tick a clock each; the number of calls that succeed.
    fn threads(shared: Shared) -> i32 {
        let (good, both) = (AtomicI32::new(0), Barrier::new(2));
        std::thread::scope(|scope| {
            for vr in [FIXED, TRIGGERED] {
                let (good, both) = (&good, &both);
                scope.spawn(move || {
                    let shared = shared;
                    both.wait();
                    for k in 1..=ROUNDS {
                        match shared.activate(vr, f64::from(k)) {
                            OK => good.fetch_add(1, SeqCst),
                            status => {
                                assert_eq!(status, ERROR);
                                std::thread::yield_now();
                                0
                            }
                        };
                    }
                });
            }
        });
        good.into_inner()
    }

    fn ticks(shared: Shared) -> i32 {
        let mut n = -1;
        assert_eq!(unsafe { fmi3GetInt32(shared.0, &TICKS, 1, &mut n, 1) }, OK);
        n
    }

    #[test]
    fn two_threads_with_a_lock() {
        let mut it: InstancePointer = null_mut();
        let shared = started(&mut it, true);
        LOCKS.store(0, SeqCst);
        assert_eq!(threads(shared), 2 * ROUNDS);
        let n = ticks(shared);
        assert_eq!((n, LOCKS.load(SeqCst), DEPTH.load(SeqCst)), (2 * ROUNDS, 2 * ROUNDS.cast_unsigned() + 1, 0));
        unsafe { fmi3FreeInstance(it) };
    }

    /// The scheduler is locked once for a call that is logged, and for the callback and the calls in it.
    pub(crate) fn logged() {
        let mut it: InstancePointer = null_mut();
        let shared = started(&mut it, true);
        LOCKS.store(0, SeqCst);
        assert_eq!((shared.activate(FIXED, 1.0), shared.activate(TRIGGERED, 2.0)), (OK, OK));
        assert_eq!((LOCKS.load(SeqCst), DEPTH.load(SeqCst)), (2, 0));
        unsafe { fmi3FreeInstance(it) };
    }

    /// A call on a busy instance is an Error without side effects; a call during a callback makes the calling function fail
    /// after its tick.
    #[test]
    fn two_threads_without_a_lock() {
        let mut it: InstancePointer = null_mut();
        let shared = started(&mut it, false);
        let (good, n) = (threads(shared), ticks(shared));
        println!("{good} of {} calls succeed", 2 * ROUNDS);
        // No call succeeds if the other thread's first one comes during the callback of the first tick: both fail.
        assert!(n > 0 && (good..=good + 1).contains(&n), "{good} calls succeed, {n} ticks");
        unsafe { fmi3FreeInstance(it) };
    }
}

#[test]
#[cfg_attr(miri, ignore = "a process")]
fn the_call_log_shows_an_update_of_clocks() {
    let [log] = &played::logs("scheduled")[..] else { panic!("one instance") };
    let at = log.find("fmi3ExitInitializationMode() -> OK\n").unwrap();
    let expected = "fmi3ExitInitializationMode() -> OK\n\
        0.0 fmi3ActivateModelPartition(clock=3, t=1.0) -> OK\n\
        1.0 fmi3ActivateModelPartition(clock=7, t=2.0) {\n  \
          1.0 clockUpdate() {\n    \
            2.0 fmi3GetClock(vr=[8], n=1, values=?1) -> OK values=[0]\n  \
          } -> done\n\
        } -> OK\n\
        2.0 fmi3FreeInstance() -> done\n";
    assert_eq!(&log[at..], expected);
}
