//! Random calls between steps and inside them, against FMI 3.0.2, 2.3 and 4.2.2, written down once more by hand.

use super::oracle::{self, Call, Oracle, State, Statuses, Turn, random_calls, verdict};
use super::*;
use State::{Initialization, Instantiated, Step, Terminated};
use fmu_core::draw::Draw;
use std::fmt::Write;

/// A step in progress, in equal parts of at most 10 ms.
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

/// The expected state of an instance.
#[derive(Clone, Default)]
struct Twin {
    state: State,
    end: f64,
    model: Lag,
    /// `x` as its output shows it, and at the last communication point.
    x: f64,
    shown: f64,
    plan: Option<Plan>,
}

impl Twin {
    fn is(&self, states: &[State]) -> bool {
        states.contains(&self.state)
    }

    /// One more part of the step; whether the model does it.
    fn part(&mut self, plan: &mut Plan) -> bool {
        let h = plan.h / plan.parts;
        if self.model.advance(&fmu_core::Step { start: Elapsed::ZERO, h }).is_err() {
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

    /// A step, with the actions of the callback inside it.
    fn step(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let h = turn.mostly(&[0.1, 0.07, 0.005, 0.013, 1e-4], &[0.0, -0.1, f64::NAN]);
        let t = self.end + turn.mostly(&[0.0], &[h, -h]);
        turn.note((t, h));
        if !(self.is(&[Step]) && t == self.end && h > 0.0) {
            return [turn.importer.do_step(t, h).status, ERROR];
        }
        (self.shown, self.plan) = (self.x, Some(Plan::new(t, h)));
        // The callback continues with this state, these choices and this trace.
        let host = turn.importer.clone();
        host.inside.replace(Inside { twin: self.clone(), draw: turn.draw.clone(), trace: turn.trace.clone() });
        let stepped = host.do_step(t, h);
        let Inside { twin, draw, trace } = host.inside.take();
        (*self, *turn.draw, *turn.trace) = (twin, draw, trace);
        let mut plan = self.plan.take().expect("it is under way");
        // Without a callback, the whole step.
        while !host.called && plan.done < plan.parts && self.part(&mut plan) {}
        if plan.done < plan.parts {
            assert!(!self.is(&[Step]) || self.model.u > 1e6, "{}", turn.trace);
            self.state = State::Error;
        }
        if self.is(&[Step]) {
            self.end = plan.end;
            assert_eq!((stepped.early, stepped.end), (plan.early, plan.end), "{}", turn.trace);
        }
        [stepped.status, verdict(self.is(&[Step]))]
    }

    fn set(&mut self, turn: &mut Turn<'_, Self>) -> Statuses {
        let (vr, x) = (turn.mostly(&[U], &[X, TWICE, 77]), turn.mostly(&[0.5, 1.0, -3.0], &[f64::NAN, 2e6]));
        turn.note((vr, x));
        self.model.u = x;
        let fits = self.is(&[Instantiated, Initialization, Step]) && vr == U && x.is_finite();
        [set(turn.importer.it.get(), vr, x), verdict(fits)]
    }

    fn compare(&self, it: InstancePointer, vr: u32, trace: &str) {
        let (seen, expected) = (get(it, vr), self.value(vr, false));
        assert_eq!(seen.map(f64::to_bits), Some(expected.to_bits()), "{vr}: {seen:?} {expected} {trace}");
    }

    /// A call without arguments in one state, and the state that it leads to.
    fn plain(&mut self, from: State, to: State, status: c_int) -> Statuses {
        let wanted = verdict(self.state == from);
        self.state = to;
        [status, wanted]
    }
}

/// The turn of a callback.
struct Inside {
    twin: Twin,
    draw: Draw,
    trace: String,
}

impl Default for Inside {
    fn default() -> Self {
        Self { twin: Twin::default(), draw: Draw(0), trace: String::new() }
    }
}

/// An importer with one instance; the environment of its callback.
#[repr(C)]
struct Host {
    // The first field, because the logger treats the environment as a journal.
    journal: Journal,
    it: Cell<InstancePointer>,
    called: bool,
    early: bool,
    required: Vec<u32>,
    inside: RefCell<Inside>,
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
    let Inside { twin, draw, trace } = &mut *host.inside.borrow_mut();
    let mut plan = twin.plan.expect("a step is under way");
    let goes_on = plan.done < plan.parts && twin.part(&mut plan);
    let flags = [set.0, get.0, finished.0, can_return.0];
    assert!(goes_on && flags == [1, 1, 1, host.early.into()], "{flags:?} {trace}");
    assert_eq!(time.to_bits(), twin.end.to_bits(), "{time} {trace}");
    for _ in 0..draw.below(3) {
        if !host.act(twin, draw, trace) {
            twin.state = State::Error;
        }
    }
    if twin.is(&[Step]) && draw.below(8) == 0 {
        let away = (plan.end - time) * draw.of(&[0.0, 0.3, 0.5, 1.0]);
        let wrong = draw.below(20) == 0;
        let end = if wrong { draw.of(&[time - 0.01, plan.end + 0.01, f64::NAN]) } else { time + away };
        let _ = write!(trace, " until {end}");
        unsafe { (*requested, *until) = (Fmi3Boolean(1), end) };
        if host.early && !(time..=plan.end).contains(&end) {
            twin.state = State::Error;
        } else if host.early {
            let early = plan.early || end < plan.end;
            // A step that ends here leaves no trace.
            let rest = Plan { done: 1.0, parts: 1.0, end, ..plan };
            plan = if end > time { Plan::new(time, end - time) } else { rest };
            (plan.early, plan.end) = (early, end);
        }
    }
    twin.plan = Some(plan);
}

impl Host {
    fn open(draw: &mut Draw) -> Rc<Self> {
        let required = draw.of(&[&[][..], &[U], &[X, TWICE], &[U, X, TWICE], &[U, X, TWICE, ON, HELD]]).to_vec();
        let (called, early) = (draw.of(&[true, true, true, false]), draw.of(&[true, false]));
        let (it, inside_it) = (Cell::new(null_mut()), RefCell::default());
        let host = Rc::new(Self { journal: Journal::default(), it, called, early, required, inside: inside_it });
        let (token, no) = (CString::new(This::TOKEN.as_str()).unwrap(), Fmi3Boolean(0));
        let (name, token, early) = (c"it".as_ptr(), token.as_ptr(), Fmi3Boolean(early.into()));
        let (list, n) = (host.required.as_ptr(), host.required.len());
        let (of, log, update) = (Rc::as_ptr(&host).cast_mut().cast(), Some(log3 as _), called.then_some(inside as _));
        let it =
            unsafe { fmi3InstantiateCoSimulation(name, token, null(), no, no, no, early, list, n, of, log, update) };
        assert!(!it.is_null());
        host.it.set(it);
        host
    }

    /// A call inside a step; returns whether the step can continue.
    fn act(&self, twin: &mut Twin, draw: &mut Draw, trace: &mut String) -> bool {
        let it = self.it.get();
        let name = if draw.below(20) == 0 {
            draw.of(&["step", "reset", "terminate", "save", "exit", "event", "free"])
        } else {
            draw.of(&["get", "get", "set"])
        };
        let wanted: Vec<u32> = self.required.iter().copied().filter(|vr| name != "set" || *vr == U).collect();
        let any = draw.below(20) == 0 || wanted.is_empty();
        let vr = if any { draw.of(&[TIME, U, X, TWICE, HELD]) } else { draw.of(&wanted) };
        let x = if draw.below(20) == 0 { draw.of(&[f64::NAN, 2e6]) } else { draw.of(&[0.0, 1.0, -2.5]) };
        let _ = write!(trace, " ({name} {vr} {x})");
        // After a failed call, only the end of the step is allowed.
        let good = twin.is(&[Step]);
        let (status, fits) = match name {
            "get" if vr == ON || vr == HELD => return good,
            "get" => {
                let (seen, expected) = (get(it, vr), twin.value(vr, true));
                let fits = good && (vr == TIME || self.required.contains(&vr));
                assert!(!fits || seen.map(f64::to_bits) == Some(expected.to_bits()), "{seen:?} {trace}");
                (verdict(seen.is_some()), fits)
            }
            "set" => {
                let fits = good && vr == U && self.required.contains(&U) && x.is_finite();
                if fits {
                    twin.model.u = x;
                }
                (set(it, vr, x), fits)
            }
            // Freeing has no effect here.
            "free" => {
                unsafe { fmi3FreeInstance(it) };
                return good;
            }
            "step" => (self.do_step(0.0, 0.1).status, false),
            "reset" => (unsafe { fmi3Reset(it) }, false),
            "terminate" => (unsafe { fmi3Terminate(it) }, false),
            "save" => (unsafe { fmi3GetFMUState(it, &mut null_mut()) }, false),
            "exit" => (unsafe { fmi3ExitInitializationMode(it) }, false),
            _ => (unsafe { fmi3EnterEventMode(it) }, false),
        };
        assert_eq!(status, verdict(fits), "{trace}");
        fits
    }

    fn do_step(&self, t: f64, h: f64) -> Stepped {
        let (mut event, mut end, mut early, mut last) = (Fmi3Boolean(9), Fmi3Boolean(9), Fmi3Boolean(9), f64::NAN);
        let no = Fmi3Boolean(0);
        let status = unsafe { fmi3DoStep(self.it.get(), t, h, no, &mut event, &mut end, &mut early, &mut last) };
        Stepped { status, early: early.0 == 1, end: last }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        unsafe { fmi3FreeInstance(self.it.get()) }
    }
}

impl oracle::Importer for Rc<Host> {
    fn it(&self) -> InstancePointer {
        self.it.get()
    }
}

impl Oracle for Twin {
    type Importer = Rc<Host>;
    const CALLS: &'static [Call] = &[
        Call::Enter,
        Call::Exit,
        Call::Set,
        Call::Get,
        Call::Step,
        Call::Terminate,
        Call::Reset,
        Call::Save,
        Call::Restore,
    ];
    const WILD: usize = 20;

    fn open(draw: &mut Draw) -> (Rc<Host>, Self) {
        (Host::open(draw), Self::default())
    }

    fn state(&mut self) -> &mut State {
        &mut self.state
    }

    fn next(&self) -> &'static [Call] {
        use Call::*;
        match self.state {
            Instantiated => &[Enter, Enter, Set, Get],
            Initialization => &[Exit, Exit, Set, Get],
            State::Step => &[Step, Step, Step, Set, Get, Save, Restore],
            _ => &[Reset, Reset, Get, Restore],
        }
    }

    fn call(&mut self, call: Call, turn: &mut Turn<'_, Self>) -> Statuses {
        let (it, no) = (turn.importer.it.get(), Fmi3Boolean(0));
        match call {
            Call::Enter => {
                let status = unsafe { fmi3EnterInitializationMode(it, no, 0.0, 0.0, no, 0.0) };
                self.plain(Instantiated, Initialization, status)
            }
            Call::Exit => self.plain(Initialization, Step, unsafe { fmi3ExitInitializationMode(it) }),
            Call::Terminate => self.plain(Step, Terminated, unsafe { fmi3Terminate(it) }),
            Call::Reset => {
                *self = Self::default();
                [unsafe { fmi3Reset(it) }, OK]
            }
            Call::Set => self.set(turn),
            Call::Get => {
                self.compare(it, turn.draw.of(&[TIME, U, X, TWICE]), turn.trace);
                [OK, OK]
            }
            Call::Step => self.step(turn),
            _ => unreachable!(),
        }
    }

    /// The model has done a part of a step that fails.
    fn failed(self, before: Self, call: Call) -> Self {
        if call == Call::Step { self } else { before }
    }

    /// Everything that can be read.
    fn look(&mut self, host: &Rc<Host>, trace: &str) {
        for vr in [TIME, U, X, TWICE] {
            self.compare(host.it.get(), vr, trace);
        }
    }
}

#[test]
fn random_calls_inside_steps() {
    random_calls::<Twin>(5_000);
}
