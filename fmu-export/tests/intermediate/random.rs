//! Random calls, right and wrong, between steps and inside them, of two instances that share saved states, against a state table
//! written down once more by hand from FMI 3.0.2, 2.3 and 4.2.2. 2e4 calls; `FMU_CALLS=1000000` for more, `FMU_SEED` for others.

use super::draw::{Choices as _, Draw};
use super::*;
use std::fmt::Write;

/// A step that is under way, in equal parts of at most 10 ms.
#[derive(Clone, Copy)]
struct Plan {
    t: f64,
    h: f64,
    parts: f64,
    done: f64,
    end: f64,
    early: bool,
}

impl Plan {
    fn new(t: f64, h: f64) -> Self {
        Self { t, h, parts: (h / 1e-2 - 1e-9).ceil().max(1.0), done: 0.0, end: t + h, early: false }
    }
}

/// The expected state of an instance: i instantiated, n initialization, s step, t terminated, e error.
#[derive(Clone)]
struct Twin {
    state: char,
    end: f64,
    model: Lag,
    /// `x` as its output shows it, and at the last communication point.
    x: f64,
    shown: f64,
    plan: Option<Plan>,
}

impl Twin {
    fn new() -> Self {
        Self { state: 'i', end: 0.0, model: Lag::default(), x: 0.0, shown: 0.0, plan: None }
    }

    fn is(&self, states: &str) -> bool {
        states.contains(self.state)
    }

    /// One more part of the step; whether the model does it.
    fn part(&mut self, plan: &mut Plan) -> bool {
        let h = plan.h / plan.parts;
        if self.model.advance(&Step { start: Elapsed::ZERO, h }).is_err() {
            return false;
        }
        plan.done += 1.0;
        self.x = self.model.x;
        self.end = if plan.done < plan.parts { (plan.t + plan.done * h).min(plan.end) } else { plan.end };
        true
    }

    /// The value of a getter, `inside` a step or between two.
    fn value(&self, vr: u32, inside: bool) -> f64 {
        match vr {
            TIME => self.end,
            U => self.model.u,
            X => self.x,
            _ => 2.0 * if inside { self.shown } else { self.x },
        }
    }
}

/// An importer with one instance, its expected state, and its actions; the environment of its callback.
#[repr(C)]
struct Host {
    // The first field, because the logger treats the environment as a journal.
    journal: Journal,
    it: Cell<InstancePointer>,
    called: bool,
    early: bool,
    required: Vec<u32>,
    twin: RefCell<Twin>,
    all: Rc<Shared>,
}

struct Shared {
    draw: RefCell<Draw>,
    trace: RefCell<String>,
    /// Calls that succeed, and those that do not.
    calls: [Cell<u64>; 2],
}

impl Shared {
    fn of<T: Copy>(&self, list: &[T]) -> T {
        self.draw.borrow_mut().of(list)
    }

    fn rarely(&self) -> bool {
        self.draw.borrow_mut().rarely()
    }

    fn below(&self, n: usize) -> usize {
        self.draw.borrow_mut().below(n)
    }

    /// A call that `may` succeed has ended.
    fn done(&self, status: c_int, may: bool) -> bool {
        assert_eq!(status, if may { OK } else { ERROR }, "{}", self.trace.borrow());
        let count = &self.calls[usize::from(!may)];
        count.set(count.get() + 1);
        may
    }
}

/// The callback: compares its arguments, then reads and sets variables, mostly in allowed ways.
extern "C" fn inside(
    environment: *mut c_void,
    time: f64,
    set: Fmi3Boolean,
    get: Fmi3Boolean,
    finished: Fmi3Boolean,
    can_return: Fmi3Boolean,
    requested: *mut Fmi3Boolean,
    until: *mut f64,
) {
    let host = unsafe { &*environment.cast::<Host>() };
    let all = &host.all;
    let mut plan = host.twin.borrow().plan.expect("a step is under way");
    let goes_on = plan.done < plan.parts && host.twin.borrow_mut().part(&mut plan);
    let flags = [set.0, get.0, finished.0, can_return.0];
    assert!(goes_on && flags == [1, 1, 1, host.early.into()], "{flags:?} {}", all.trace.borrow());
    assert_eq!(time.to_bits(), host.twin.borrow().end.to_bits(), "{time} {}", all.trace.borrow());
    for _ in 0..all.below(3) {
        if !host.act() {
            host.twin.borrow_mut().state = 'e';
        }
    }
    if host.twin.borrow().is("s") && all.below(8) == 0 {
        let away = (plan.end - time) * all.of(&[0.0, 0.3, 0.5, 1.0]);
        let end = if all.rarely() { all.of(&[time - 0.01, plan.end + 0.01, f64::NAN]) } else { time + away };
        let _ = write!(all.trace.borrow_mut(), " until {end}");
        unsafe { (*requested, *until) = (Fmi3Boolean(1), end) };
        match () {
            () if !host.early => {}
            () if !(time..=plan.end).contains(&end) => host.twin.borrow_mut().state = 'e',
            () => {
                let early = plan.early || end < plan.end;
                // A step that ends here leaves no trace.
                let rest = Plan { done: 1.0, parts: 1.0, end, ..plan };
                plan = if end > time { Plan::new(time, end - time) } else { rest };
                (plan.early, plan.end) = (early, end);
            }
        }
    }
    host.twin.borrow_mut().plan = Some(plan);
}

impl Host {
    fn open(all: &Rc<Shared>) -> Rc<Self> {
        fmu_export::abi::quiet();
        drop(std::panic::take_hook());
        let required = all.of(&[&[][..], &[U], &[X, TWICE], &[U, X, TWICE], &[U, X, TWICE, ON, HELD]]).to_vec();
        let (called, early) = (all.of(&[true, true, true, false]), all.of(&[true, false]));
        let (it, twin) = (Cell::new(null_mut()), RefCell::new(Twin::new()));
        let host = Rc::new(Self { journal: Journal::default(), it, called, early, required, twin, all: all.clone() });
        let (token, no) = (CString::new(This::TOKEN.as_str()).unwrap(), Fmi3Boolean(0));
        let (name, token, early) = (c"it".as_ptr(), token.as_ptr(), Fmi3Boolean(early.into()));
        let (list, n) = (host.required.as_ptr(), host.required.len());
        let (environment, update) = (Rc::as_ptr(&host).cast_mut().cast(), called.then_some(inside as _));
        host.it.set(unsafe {
            fmi3InstantiateCoSimulation(
                name,
                token,
                null(),
                no,
                no,
                no,
                early,
                list,
                n,
                environment,
                Some(log3),
                update,
            )
        });
        assert!(!host.it.get().is_null());
        host
    }

    /// A call inside a step; whether the step can go on.
    fn act(&self) -> bool {
        let (all, it) = (&self.all, self.it.get());
        let name = if all.rarely() {
            all.of(&["step", "reset", "terminate", "save", "exit", "event", "free"])
        } else {
            all.of(&["get", "get", "set"])
        };
        let wanted: Vec<u32> = self.required.iter().copied().filter(|vr| name != "set" || *vr == U).collect();
        let vr = if all.rarely() || wanted.is_empty() { all.of(&[TIME, U, X, TWICE, HELD]) } else { all.of(&wanted) };
        let x = if all.rarely() { all.of(&[f64::NAN, 2e6]) } else { all.of(&[0.0, 1.0, -2.5]) };
        let _ = write!(all.trace.borrow_mut(), " ({name} {vr} {x})");
        // After a failed call, nothing but the end of the step leads on.
        let good = self.twin.borrow().is("s");
        match name {
            "get" if vr != ON && vr != HELD => {
                let seen = get(it, vr);
                let may = good && (vr == TIME || self.required.contains(&vr));
                let expected = self.twin.borrow().value(vr, true);
                assert!(!may || seen.map(f64::to_bits) == Some(expected.to_bits()), "{seen:?} {}", all.trace.borrow());
                all.done(if seen.is_some() { OK } else { ERROR }, may) || !good
            }
            "set" => {
                let may = good && vr == U && self.required.contains(&U) && x.is_finite();
                if may {
                    self.twin.borrow_mut().model.u = x;
                }
                all.done(set(it, vr, x), may)
            }
            "free" => {
                unsafe { fmi3FreeInstance(it) };
                good
            }
            "step" => all.done(self.do_step(0.0, 0.1).status, false),
            "reset" => all.done(unsafe { fmi3Reset(it) }, false),
            "terminate" => all.done(unsafe { fmi3Terminate(it) }, false),
            "save" => all.done(unsafe { fmi3GetFMUState(it, &mut null_mut()) }, false),
            "exit" => all.done(unsafe { fmi3ExitInitializationMode(it) }, false),
            "event" => all.done(unsafe { fmi3EnterEventMode(it) }, false),
            _ => good,
        }
    }

    fn do_step(&self, t: f64, h: f64) -> Stepped {
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(9), Fmi3Boolean(9), Fmi3Boolean(9), f64::NAN);
        let no = Fmi3Boolean(0);
        let status = unsafe { fmi3DoStep(self.it.get(), t, h, no, &mut event, &mut end, &mut early, &mut last) };
        Stepped { status, early: early.0 == 1, end: last }
    }

    /// A step, with the actions of the callback inside it.
    fn step(&self) -> bool {
        let all = &self.all;
        let h = if all.rarely() { all.of(&[0.0, -0.1, f64::NAN]) } else { all.of(&[0.1, 0.07, 0.005, 0.013, 1e-4]) };
        let t = self.twin.borrow().end + if all.rarely() { all.of(&[h, -h]) } else { 0.0 };
        let _ = write!(all.trace.borrow_mut(), " {t} {h}");
        let may = { self.twin.borrow().is("s") && t == self.twin.borrow().end && h > 0.0 };
        if may {
            let mut twin = self.twin.borrow_mut();
            (twin.shown, twin.plan) = (twin.x, Some(Plan::new(t, h)));
        }
        let stepped = self.do_step(t, h);
        let Some(mut plan) = self.twin.borrow_mut().plan.take().filter(|_| may) else {
            self.twin.borrow_mut().state = 'e';
            return all.done(stepped.status, false);
        };
        let mut twin = self.twin.borrow_mut();
        // Without a callback, all of it.
        while !self.called && plan.done < plan.parts && twin.part(&mut plan) {}
        if plan.done < plan.parts {
            assert!(!twin.is("s") || twin.model.u > 1e6, "{}", all.trace.borrow());
            twin.state = 'e';
        }
        let good = twin.is("s");
        if good {
            twin.end = plan.end;
            assert_eq!((stepped.early, stepped.end), (plan.early, plan.end), "{}", all.trace.borrow());
        }
        drop(twin);
        all.done(stepped.status, good)
    }

    /// A call between steps.
    fn call(&self, name: &str) -> bool {
        let (all, it, no) = (&self.all, self.it.get(), Fmi3Boolean(0));
        let state = self.twin.borrow().state;
        let is = |states: &str| states.contains(state);
        let (may, next, status) = match name {
            "enter" => (is("i"), 'n', unsafe { fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0) }),
            "exit" => (is("n"), 's', unsafe { fmi3ExitInitializationMode(it) }),
            "terminate" => (is("s"), 't', unsafe { fmi3Terminate(it) }),
            "reset" => {
                *self.twin.borrow_mut() = Twin::new();
                (true, 'i', unsafe { fmi3Reset(it) })
            }
            "set" => {
                let vr = if all.rarely() { all.of(&[X, TWICE, 77]) } else { U };
                let x = if all.rarely() { all.of(&[f64::NAN, 2e6]) } else { all.of(&[0.5, 1.0, -3.0]) };
                let may = is("ins") && vr == U && x.is_finite();
                if may {
                    self.twin.borrow_mut().model.u = x;
                }
                (may, state, set(it, vr, x))
            }
            _ => {
                let vr = all.of(&[TIME, U, X, TWICE]);
                let (seen, expected) = (get(it, vr), self.twin.borrow().value(vr, false));
                let bits = (seen.map(f64::to_bits), Some(expected.to_bits()));
                assert_eq!(bits.0, bits.1, "{vr}: {seen:?} {expected} {}", all.trace.borrow());
                (true, state, OK)
            }
        };
        self.twin.borrow_mut().state = if may { next } else { 'e' };
        all.done(status, may)
    }

    /// Everything that can be read.
    fn look(&self) {
        for vr in [TIME, U, X, TWICE] {
            let (seen, expected) = (get(self.it.get(), vr), self.twin.borrow().value(vr, false));
            let same = seen.map(f64::to_bits) == Some(expected.to_bits());
            assert!(same, "{vr}: {seen:?}, not {expected} {}", self.all.trace.borrow());
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.it.get()) }
    }
}

/// 200 calls between steps of two instances, and many more inside their steps.
fn sequence(all: &Rc<Shared>) {
    all.trace.borrow_mut().clear();
    let hosts = [Host::open(all), Host::open(all)];
    let mut saved: (*mut c_void, Option<Twin>) = (null_mut(), None);
    for _ in 0..200 {
        let who = all.below(2);
        let host = &hosts[who];
        let state = host.twin.borrow().state;
        let name = match state {
            _ if all.rarely() => {
                all.of(&["enter", "exit", "set", "get", "step", "terminate", "reset", "save", "restore"])
            }
            'i' => all.of(&["enter", "enter", "set", "get"]),
            'n' => all.of(&["exit", "exit", "set", "get"]),
            's' => all.of(&["step", "step", "step", "set", "get", "save", "restore"]),
            _ => all.of(&["reset", "reset", "get", "restore"]),
        };
        let _ = write!(all.trace.borrow_mut(), "\n{who} {state} {name}");
        let good = match name {
            "step" => host.step(),
            "save" => {
                let may = state != 'e';
                let status = unsafe { fmi3GetFMUState(host.it.get(), &mut saved.0) };
                if may {
                    saved.1 = Some(host.twin.borrow().clone());
                } else {
                    host.twin.borrow_mut().state = 'e';
                }
                all.done(status, may)
            }
            "restore" => {
                let may = saved.1.is_some();
                let status = unsafe { fmi3SetFMUState(host.it.get(), saved.0) };
                match &saved.1 {
                    Some(twin) => host.twin.borrow_mut().clone_from(twin),
                    None => host.twin.borrow_mut().state = 'e',
                }
                all.done(status, may)
            }
            _ => host.call(name),
        };
        if !good || all.below(4) == 0 {
            for host in &hosts {
                host.look();
            }
        }
    }
    unsafe { fmi3FreeFMUState(hosts[0].it.get(), &mut saved.0) };
}

#[test]
fn random_calls_inside_steps() {
    let asked = |name: &str, otherwise| std::env::var(name).map_or(otherwise, |text| text.parse().unwrap());
    let (calls, draw) = (asked("FMU_CALLS", 20_000), RefCell::new(Draw(asked("FMU_SEED", 1))));
    let all = Rc::new(Shared { draw, trace: RefCell::default(), calls: Default::default() });
    while all.calls.iter().map(Cell::get).sum::<u64>() < calls {
        sequence(&all);
    }
    let [good, bad] = all.calls.each_ref().map(Cell::get);
    println!("{good} of {} calls succeed", good + bad);
    assert!(good > bad && bad > 0);
}
