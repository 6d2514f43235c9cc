//! Values that the user set without effect: each is reported once, with the reason.
#![allow(missing_docs)]

use fmu_core::idle::Watch;
use fmu_core::unit::{ONE, VOLT};
use fmu_core::*;

/// Everything acts but in mode 0.
#[derive(Default)]
struct Idle {
    mode: i32,
    gain: f64,
    flag: bool,
    zero: f64,
    u: f64,
    v: f64,
}

type V = Row<Block<Idle>>;

impl Model for Idle {
    type Outputs = ();
    const INFO: Info = Info { name: "Idle", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::integer_parameter("mode", "", |m| &mut m.model.mode),
        V::parameter("gain", &ONE, "", |m| &mut m.model.gain),
        V::boolean_parameter("flag", "", |m| &mut m.model.flag),
        V::parameter("zero", &ONE, "", |m| &mut m.model.zero),
        V::input("u", &VOLT, "", |m| &mut m.model.u),
        V::input("v", &VOLT, "", |m| &mut m.model.v),
        V::output("y", &ONE, "", |m| &mut m.model.gain),
    ];
    fn idle(&self, name: &str) -> Option<&'static str> {
        match name {
            "mode" => None,
            "u" if self.mode == 0 => Some("mode 0 has no input"),
            _ if self.mode == 0 => Some("mode 0 has no gain"),
            _ => None,
        }
    }
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, _: &Step) -> Result<(), Fault> {
        Ok(())
    }
}

fn told(watch: &mut Watch, block: &mut Block<Idle>) -> Vec<String> {
    let mut all = Vec::new();
    watch.look(block, |text| all.push(text.to_owned()));
    all
}

#[test]
fn what_was_set_in_vain_is_told_once() {
    let (mut watch, mut block) = (Watch::default(), Block::<Idle>::default());
    (block.model.gain, block.model.flag) = (2.0, true);
    assert_eq!(told(&mut watch, &mut block), ["gain = 2, flag = true: mode 0 has no gain"]);
    assert_eq!(told(&mut watch, &mut block), [""; 0], "not again");
    // An input counts when it is set, however late.
    block.model.u = 3.0;
    assert_eq!(told(&mut watch, &mut block), ["u = 3 V: mode 0 has no input"]);
    (block.model.u, block.model.gain) = (4.0, 5.0);
    assert_eq!(told(&mut watch, &mut block), [""; 0], "parameters are checked once, and u was reported before");
}

#[test]
fn what_acts_or_requests_nothing_is_not_told() {
    let (mut watch, mut block) = (Watch::default(), Block::<Idle>::default());
    // Negative zero has other bits than the start value.
    (block.model.zero, block.model.flag) = (-0.0, false);
    assert_eq!(told(&mut watch, &mut block), [""; 0]);
    (block.model.mode, block.model.v) = (1, 2.0);
    assert_eq!(told(&mut watch, &mut block), [""; 0]);
    block.model.mode = 0;
    assert_eq!(told(&mut watch, &mut block), [""; 0], "v was set where it acted");
}
