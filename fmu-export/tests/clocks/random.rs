//! Random calls, right and wrong, of two instances that share saved states, against a state table written down once more by hand
//! from FMI 3.0.2, 2.2.8, 2.3.5 and 5. 2e4 calls; `FMU_CALLS=1000000` for more, `FMU_SEED` for others.

use super::draw::{Choices as _, Draw};
use super::*;
use std::fmt::Write;

const DISCARD: c_int = 2;

/// The expected state of an instance.
#[derive(Clone)]
struct Twin {
    kind: Kind,
    /// As in [`Host::in_state`]; x is Continuous-Time Mode.
    state: char,
    time: f64,
    model: Kinds,
    /// The clocks that the importer has activated, and those that have ticked in this Event Mode.
    active: [bool; 7],
    done: [bool; 7],
    /// Scheduled Execution: the last tick of each clock, and whether `trip` has ticked unseen.
    last: [f64; 7],
    trips: bool,
    /// Time of the last event.
    event: f64,
}

impl Twin {
    fn new(kind: Kind) -> Self {
        let no = [false; 7];
        let model = Kinds::default();
        Self { kind, state: 'i', time: 0.0, model, active: no, done: no, last: [-1.0; 7], trips: false, event: 0.0 }
    }

    fn is(&self, states: &str) -> bool {
        states.contains(self.state)
    }

    /// The model ticks the clock `number`.
    fn tick(&mut self, number: usize, now: f64) {
        let model = &mut self.model;
        model.counts[number] += 1;
        match number {
            2 => model.computed = model.u + model.x,
            5 => model.due = None,
            6 => model.due = Some(now + 0.25),
            _ => {}
        }
        self.done[number] = true;
    }

    fn update(&mut self) {
        for n in (0..7).filter(|n| self.active[*n]).collect::<Vec<_>>() {
            self.tick(n, self.time);
        }
        self.active = [false; 7];
    }

    fn ticks(&self) -> i32 {
        self.model.counts.iter().sum()
    }

    /// Whether a variable can be set, or read.
    fn open(&self, vr: u32, sets: bool) -> bool {
        let ticking = match vr {
            U => self.active[2] || self.active[6],
            Y => self.active[2],
            _ => true,
        };
        match self.state {
            'e' | 't' => !sets,
            'v' => ticking,
            's' | 'x' => ticking && (vr != U && vr != Y),
            _ => true,
        }
    }
}

/// A clock that the importer ticks; rarely the other one, a variable or no reference.
fn clock(draw: &mut Draw) -> u32 {
    if draw.rarely() { draw.of(&[TRIP, X, 99]) } else { draw.of(&CLOCKS[..7]) }
}

const CALLS: [&str; 18] = [
    "enter",
    "exit",
    "set_clock",
    "clock",
    "interval",
    "set_interval",
    "shift",
    "update",
    "leave",
    "advance",
    "event",
    "activate",
    "set",
    "get",
    "terminate",
    "reset",
    "save",
    "restore",
];

/// A plausible next call of an importer, or a random one.
fn choose(twin: &Twin, draw: &mut Draw) -> &'static str {
    if draw.below(40) == 0 {
        return draw.of(&CALLS);
    }
    match twin.state {
        'i' => draw.of(&["enter", "enter", "set", "get", "save", "restore"]),
        'n' => draw.of(&["exit", "exit", "set", "get", "interval", "shift", "save"]),
        'v' => draw.of(&[
            "set_clock",
            "set_clock",
            "clock",
            "set",
            "get",
            "interval",
            "update",
            "update",
            "leave",
            "save",
            "restore",
        ]),
        's' | 'x' => draw.of(&["advance", "event", "event", "get", "set", "save", "restore"]),
        'a' => draw.of(&["activate", "activate", "activate", "set", "get", "clock", "interval", "save", "restore"]),
        _ => draw.of(&["get", "reset", "reset", "restore"]),
    }
}

/// The number of a clock that the importer ticks.
fn number(vr: u32) -> Option<usize> {
    CLOCKS[..7].iter().position(|clock| *clock == vr)
}

/// Two instances, their expected states, and saved states.
struct World {
    its: [Rc<Host>; 2],
    twins: [Twin; 2],
    saved: [(*mut c_void, Option<Twin>); 3],
    trace: String,
}

impl World {
    fn new(draw: &mut Draw) -> Self {
        let kinds = [(); 2].map(|()| draw.of(&[Kind::Cs, Kind::Me, Kind::Se]));
        let saved = std::array::from_fn(|_| (null_mut(), None));
        Self { its: kinds.map(Host::open), twins: kinds.map(Twin::new), saved, trace: String::new() }
    }

    /// A call: whether it succeeded.
    #[expect(clippy::too_many_lines, reason = "a row for each call")]
    fn call(&mut self, draw: &mut Draw) -> bool {
        let who = draw.below(2);
        let (host, twin) = (&self.its[who].clone(), &mut self.twins[who]);
        let it = host.it.get();
        let name = choose(twin, draw);
        let _ = write!(self.trace, "\n{who} {:?} {} {name}", twin.kind, twin.state);
        let before = twin.clone();
        let scheduled = twin.kind == Kind::Se;
        let may; // Whether the call must succeed.
        let status = match name {
            "enter" => {
                may = twin.is("i");
                twin.state = 'n';
                unsafe { fmi3EnterInitializationMode(it, Fmi3Boolean(0), 0.0, 0.0, Fmi3Boolean(0), 0.0) }
            }
            "exit" => {
                may = twin.is("n");
                twin.state = if scheduled { 'a' } else { 'v' };
                twin.model.initialize();
                host.exit()
            }
            "set_clock" => {
                let (vr, active) = (clock(draw), !draw.rarely());
                let _ = write!(self.trace, " {vr} {active}");
                may = twin.is("v")
                    && number(vr).is_some_and(|n| if active { n >= 4 || !twin.done[n] } else { !twin.active[n] });
                if let (true, true, Some(n)) = (may, active, number(vr))
                    && !std::mem::replace(&mut twin.active[n], true)
                    && n == 2
                {
                    twin.model.y = twin.model.computed;
                }
                host.set_clock(vr, active)
            }
            "clock" => {
                let vr = draw.of(&CLOCKS);
                may = twin.is("va");
                let expected = match number(vr) {
                    Some(n) => twin.active[n],
                    None if scheduled => std::mem::take(&mut twin.trips),
                    None => twin.active[6] && twin.model.counts[6] % 2 == 1,
                };
                let seen = host.clock(vr);
                assert!(!may || seen == Some(expected), "{vr}: {seen:?}, not {expected} {}", self.trace);
                if seen.is_some() { OK } else { ERROR }
            }
            "interval" => {
                let vr = clock(draw);
                let _ = write!(self.trace, " {vr}");
                may = match vr {
                    CONSTANT | FRACTION | FIXED => twin.is("n"),
                    TUNABLE => twin.is("nva"),
                    CHANGING => twin.is("n") || twin.is("va") && twin.done[4],
                    COUNTDOWN => twin.is("nv"),
                    _ => false,
                };
                let seen = host.interval(vr);
                if let (TUNABLE, Some((interval, _))) = (vr, seen) {
                    assert_eq!(interval.to_bits(), twin.model.tunable.to_bits(), "{}", self.trace);
                }
                if let (CHANGING, Some((interval, _))) = (vr, seen) {
                    assert_eq!(
                        interval.to_bits(),
                        (0.1 * f64::from(twin.model.counts[4] + 1)).to_bits(),
                        "{}",
                        self.trace
                    );
                }
                if seen.is_some() { OK } else { ERROR }
            }
            "set_interval" => {
                let (vr, x) = (
                    draw.of(&[FIXED, TUNABLE, TUNABLE, CONSTANT, TRIGGERED]),
                    draw.of(&[0.4, 0.2, 0.5, 0.0, f64::NAN]),
                );
                let _ = write!(self.trace, " {vr} {x}");
                may = x > 0.0 && (vr == FIXED && twin.is("n") || vr == TUNABLE && twin.is("nva"));
                if vr == FIXED {
                    twin.model.fixed = x;
                } else {
                    twin.model.tunable = x;
                }
                host.set_interval(vr, x)
            }
            "shift" => {
                let vr = clock(draw);
                may = twin.is("n") && vr <= TUNABLE;
                let mut shift = -7.0;
                let status = unsafe { fmi3GetShiftDecimal(it, &vr, 1, &mut shift) };
                assert!(!may || shift == [0.05, 1.0, 0.0, 0.0][vr as usize - 1], "{}", self.trace);
                status
            }
            "update" => {
                may = twin.is("v");
                twin.update();
                host.update()
            }
            "leave" => {
                may = twin.is("v");
                // Active clocks tick, whether the importer updates or not.
                twin.update();
                twin.state = if twin.kind == Kind::Me { 'x' } else { 's' };
                host.leave()
            }
            "advance" => {
                let h = f64::from(u8::try_from(draw.below(5) + 1).unwrap()) * 0.0625;
                let right = draw.of(&["sx", "sx", "sx", "sx", "sxa"]);
                // FMI 3.0 does not allow SetTime in Event Mode; importers call it.
                may = (twin.is(right) || twin.is("v") && twin.kind == Kind::Me) && !scheduled;
                let to = twin.time + h;
                twin.time = to;
                if before.kind == Kind::Me {
                    unsafe { fmi3SetTime(it, to) }
                } else {
                    let ([mut a, mut b, mut c], mut last) = ([Fmi3Boolean(9); 3], 0.0);
                    unsafe { fmi3DoStep(it, before.time, h, Fmi3Boolean(0), &mut a, &mut b, &mut c, &mut last) }
                }
            }
            "event" => {
                // Nor EnterEventMode, which does nothing where no time has passed.
                let again = twin.is("v") && twin.kind == Kind::Me;
                may = twin.is("sx") || again;
                if !again || twin.time > twin.event {
                    (twin.active, twin.done, twin.event) = ([false; 7], [false; 7], twin.time);
                }
                twin.state = 'v';
                unsafe { fmi3EnterEventMode(it) }
            }
            "activate" => {
                let vr = clock(draw);
                let t = number(vr).map_or(1.0, |n| twin.last[n].max(0.0)) + if draw.rarely() { 0.0 } else { 0.125 };
                let _ = write!(self.trace, " {vr} at {t}");
                may = twin.is("a") && number(vr).is_some_and(|n| t > twin.last[n]);
                if let (true, Some(n)) = (may, number(vr)) {
                    if n == 2 {
                        twin.model.y = twin.model.computed;
                    }
                    twin.done[n] = true;
                    twin.tick(n, t);
                    twin.done = [false; 7];
                    twin.done[n] = true;
                    twin.last[n] = t;
                    twin.trips |= n == 6 && twin.model.counts[6] % 2 == 0;
                }
                host.activate(vr, t)
            }
            "set" => {
                let (vr, x) = (draw.of(&[U, X, X, Y]), draw.of(&[1.0, -2.0, 0.5]));
                let x = if draw.rarely() { f64::INFINITY } else { x };
                let _ = write!(self.trace, " {vr} {x}");
                may = twin.open(vr, true) && vr != Y && x.is_finite();
                match vr {
                    U => twin.model.u = x,
                    _ => twin.model.x = x,
                }
                host.set(vr, x)
            }
            "get" => {
                let vr = draw.of(&[U, X, Y, FREE]);
                let _ = write!(self.trace, " {vr}");
                may = twin.open(vr, false);
                let model = &twin.model;
                let expected = match vr {
                    U => model.u,
                    X => model.x,
                    Y => model.y,
                    _ => model.computed,
                };
                let seen = host.get(vr);
                assert!(
                    !may || seen.map(f64::to_bits) == Some(expected.to_bits()),
                    "{vr}: {seen:?} {expected} {} {:?}",
                    self.trace,
                    host.errors()
                );
                if seen.is_some() { OK } else { ERROR }
            }
            "terminate" => {
                may = twin.is("vsxa");
                twin.state = 't';
                unsafe { fmi3Terminate(it) }
            }
            "reset" => {
                may = true;
                *twin = Twin::new(twin.kind);
                unsafe { fmi3Reset(it) }
            }
            "save" => {
                may = !twin.is("e");
                let place = draw.below(3);
                let (state, of) = &mut self.saved[place];
                let status = unsafe { fmi3GetFMUState(it, state) };
                if status == OK {
                    *of = Some(twin.clone());
                }
                status
            }
            _ => {
                let (state, of) = &self.saved[draw.below(3)];
                may = of.as_ref().is_some_and(|of| of.kind == twin.kind);
                if may {
                    twin.clone_from(of.as_ref().unwrap());
                }
                unsafe { fmi3SetFMUState(it, *state) }
            }
        };
        if !may {
            // A solver may try values in Continuous-Time Mode.
            let state = if status == DISCARD { before.state } else { 'e' };
            assert!(status == ERROR || (before.is("x") && name == "set"), "{status} {}", self.trace);
            *twin = Twin { state, ..before };
        }
        assert_eq!(status == OK, may, "{}: {:?}", self.trace, host.errors());
        if !may || draw.below(4) == 0 {
            (0..2).for_each(|who| self.look(who));
        }
        may
    }

    /// Variables that can always be read.
    fn look(&self, who: usize) {
        let (host, twin) = (&self.its[who], &self.twins[who]);
        assert_eq!(host.ticks(), twin.ticks(), "{who} {}", self.trace);
        assert_eq!(host.get(FREE).map(f64::to_bits), Some(twin.model.computed.to_bits()), "{who} {}", self.trace);
    }
}

impl Drop for World {
    fn drop(&mut self) {
        for (state, _) in &mut self.saved {
            unsafe { fmi3FreeFMUState(self.its[0].it.get(), state) };
        }
    }
}

#[test]
fn random_calls_with_clocks() {
    let asked = |name: &str, otherwise| std::env::var(name).map_or(otherwise, |text| text.parse().unwrap());
    let (calls, mut draw) = (asked("FMU_CALLS", 20_000), Draw(asked("FMU_SEED", 1)));
    let (mut done, mut good) = (0, 0);
    while done < calls {
        let mut world = World::new(&mut draw);
        for _ in 0..200 {
            good += u64::from(world.call(&mut draw));
            done += 1;
        }
    }
    println!("{good} of {done} calls succeed");
    assert!(2 * good > done && good < done);
}
