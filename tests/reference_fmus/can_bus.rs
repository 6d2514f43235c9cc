//! `examples/can-bus`: two nodes that exchange frames as bytes on clocks.

use super::{archive, checks, packed};
use fmu_import::{Fmu, Number};
use fmu_system::cosimulation::{Recording, Schedule, Settings, System};
use model_description::FmiVersion::V3;
use std::ops::ControlFlow;

/// A frame with this identifier, and its confirmation, as in FMI-LS-BUS 1.0.0: operations in hexadecimal digits.
fn operations(id: u8, speed: f64) -> [String; 2] {
    let hex = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().concat();
    let frame = [&[0x10, 0, 0, 0, 24, 0, 0, 0, id, 1, 0, 0, 0, 0, 8, 0][..], &speed.to_le_bytes()].concat();
    [hex(&frame), hex(&[0x20, 0, 0, 0, 12, 0, 0, 0, id, 1, 0, 0])]
}

/// Ten steps of 4 ms; a frame every 10 ms.
fn run(connect: impl Fn(&mut System)) -> Recording {
    let mut system = System::default();
    for (name, package) in [("sensor", "can-sensor"), ("display", "can-display")] {
        system.add(name, &Fmu::open(archive(package, V3)).unwrap(), false).unwrap();
    }
    connect(&mut system);
    system.set("sensor.id", "258").unwrap();
    system.input("sensor.speed", Schedule::parse("0:1.5,0.025:2.5").unwrap()).unwrap();
    for name in ["display.speed", "display.frames", "sensor.confirmed", "display.id"] {
        system.record(name).unwrap();
    }
    system.record_text_as("sensor.Tx_Data", "frame").unwrap();
    system.record_text_as("display.Tx_Data", "answer").unwrap();
    let settings = Settings { start: 0.0, stop: 0.04, step: 0.004, sequential: false };
    system.run(&settings, |_| Ok(ControlFlow::Continue(()))).unwrap()
}

/// Frames, including equal ones, arrive at their instants and are confirmed at the same instant; before the first there is no
/// value.
#[test]
fn frames_travel_between_two_nodes() {
    let by_terminal = run(|system| {
        let connected = system.connect_terminals("sensor.bus", "display.bus").unwrap();
        assert!(connected.contains(&("sensor.Tx_Clock".into(), "display.Rx_Clock".into())), "{connected:?}");
        assert!(connected.contains(&("display.Tx_Data".into(), "sensor.Rx_Data".into())), "{connected:?}");
    });
    let by_hand = run(|system| {
        for (from, to) in [("sensor", "display"), ("display", "sensor")] {
            for what in ["Clock", "Data"] {
                system.connect(&format!("{from}.Tx_{what}"), &format!("{to}.Rx_{what}")).unwrap();
            }
        }
    });
    let csv = |recording: &Recording| {
        let mut csv = Vec::new();
        recording.write_csv(&mut csv).unwrap();
        String::from_utf8(csv).unwrap()
    };
    assert_eq!(csv(&by_terminal), csv(&by_hand));
    let [frame, answer] = operations(2, 1.5);
    for (k, t) in by_hand.time.iter().enumerate() {
        let sent = if *t < 0.01 {
            0
        } else if *t < 0.02 {
            1
        } else if *t < 0.03 {
            2
        } else if *t < 0.04 {
            3
        } else {
            4
        };
        let speed = if sent < 3 { 1.5 } else { 2.5 };
        let at = |name: &str| by_hand.column(name).unwrap().at(k);
        let text = |column: usize| by_hand.texts[column].values[k].as_str();
        if sent == 0 {
            assert!(["display.speed", "display.frames", "sensor.confirmed"].map(at) == [Number::Missing; 3], "{t}");
            assert_eq!([text(0), text(1)], ["", ""], "{t}");
            continue;
        }
        assert_eq!([at("display.frames"), at("sensor.confirmed")], [Number::Integer(sent); 2], "{t}");
        assert_eq!([at("display.speed"), at("display.id")], [Number::Real(speed), Number::Integer(258)], "{t}");
        assert_eq!([text(0), text(1)], [operations(2, speed)[0].as_str(), &answer], "{t}");
    }
    let csv = csv(&by_hand);
    assert!(
        csv.contains("\n0.004,,,,,,\n") && csv.contains(&format!("\n0.012,1.5,1,1,258,{frame},{answer}\n")),
        "{csv}"
    );
}

#[test]
fn the_nodes_violate_nothing() {
    for package in ["can-sensor", "can-display"] {
        checks(package);
        assert_eq!(packed(package).len(), 1, "{package}: FMI 2.0 has neither bytes nor clocks");
    }
}
