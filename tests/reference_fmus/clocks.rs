//! `clocks`: an importer that generates its ticks.

use super::{archive, open, script};
use fmu_import::{Instance, Kind, Values};
use model_description::FmiVersion::V3;

/// `inClock1` ticks by itself, `inClock3` on request, `inClock2` when the test ticks it; the output clock at totals of 5.
#[test]
fn clocks_tick_by_their_kinds() {
    for kind in [Kind::CoSimulation { event_mode: true, early_return: false }, Kind::ModelExchange] {
        let fmu = open("clocks");
        let mut it = fmu.instantiate_as(kind, "it", false).unwrap();
        let number = |it: &mut Instance, name: &str| it.get(name).unwrap().number().unwrap();
        it.setup(0.0, None).unwrap();
        it.enter_initialization().unwrap();
        it.exit_initialization().unwrap();
        let mut rows = Vec::new();
        for k in 0..10_u32 {
            let t = f64::from(k);
            let mut trips = false;
            for second in [false, true] {
                if second && ![0, 1, 8, 9].contains(&k) {
                    continue;
                }
                if second {
                    it.set("inClock2", Values::Booleans(vec![true])).unwrap();
                }
                loop {
                    trips |= it.get("outClock").unwrap() == Values::Booleans(vec![true]);
                    let total = number(&mut it, "totalInClockTicks");
                    let update = it.update_discrete_states().unwrap();
                    assert!(total > 0.0 && update.next_event_time == Some(if update.again { t } else { t + 1.0 }));
                    if !update.again {
                        break;
                    }
                }
            }
            rows.push((number(&mut it, "totalInClockTicks"), trips));
            match kind {
                Kind::ModelExchange => {
                    it.enter_continuous_time_mode().unwrap();
                    it.set_time(t + 1.0).unwrap();
                }
                Kind::CoSimulation { .. } => {
                    it.enter_step_mode().unwrap();
                    let _ = it.advance(t, 1.0).unwrap();
                }
            }
            it.enter_event_mode().unwrap();
        }
        let expected = [(2, false), (4, false), (5, true), (6, false), (8, false), (9, false), (10, true), (11, false)];
        let expected = expected.iter().chain(&[(13, false), (15, true)]).map(|&(n, trips)| (f64::from(n), trips));
        assert_eq!(rows, expected.collect::<Vec<_>>(), "{kind:?}");
    }
}

#[test]
fn fmpy_validates_the_clocks() {
    let said = script(
        "import sys, fmpy\n\
         from fmpy.validation import validate_fmu\n\
         assert validate_fmu(sys.argv[1]) == []\n\
         variables = fmpy.read_model_description(sys.argv[1]).modelVariables\n\
         print(*(f'{v.name} {v.intervalVariability}' for v in variables if v.type == 'Clock'))\n",
        &[&archive("clocks", V3)],
    );
    assert_eq!(said.trim(), "inClock1 constant inClock2 triggered inClock3 countdown outClock triggered");
}
