//! Wrong arguments of the C functions: the code, a text that names the argument, its value and what is allowed, and a motor that has
//! not changed. And what right ones give.
#![allow(missing_docs, non_snake_case, clippy::undocumented_unsafe_blocks)]

mod common;

use common::{
    Refused, adc, advance, advance_gates, checked, create, create_from_file, create_from_preset, create_from_text,
    destroy, error_text, find, get, get_adc, hall, named, set, set_adc, set_encoder, terminals, time,
};
use std::ffi::CStr;
use std::ptr::{null, null_mut};
use virtual_motor::ErrorCode::{self, *};
use virtual_motor::abi::*;
use virtual_motor::pool::{MOST, MotorId};
use virtual_motor::sensing::{AdcSetup, EncoderSetup, LINK, LOW_SIDE};

const T: f64 = 50e-6;

#[track_caller]
fn refused<T: std::fmt::Debug>(result: Result<T, Refused>, code: ErrorCode, text: &str) {
    let (found, said) = result.unwrap_err();
    assert_eq!(found, code as i32, "{said}");
    assert!(said.contains(text), "{said}");
}

/// The values of all variables, bit for bit.
fn values(id: MotorId) -> Vec<u64> {
    (1..).map_while(|variable| get(id, variable).ok()).map(f64::to_bits).collect()
}

#[test]
fn every_wrong_argument_is_named() {
    let id = create().unwrap();
    set(id, named("inverter.T_pwm"), T).unwrap();
    for k in 1..=20_u32 {
        advance(id, T * f64::from(k), [0.6, 0.45, 0.45], true).unwrap();
    }
    let before = values(id);
    assert!(before.len() > 150);
    let (t, adc_setup) = (21.0 * T, get_adc(id).unwrap());
    refused(advance(id, f64::NAN, [0.5; 3], true), BadTime, "t = NaN s is not allowed: a finite time from the present");
    refused(
        advance(id, 0.0009, [0.5; 3], true),
        BadTime,
        "t = 0.0009 s is not allowed: a finite time from the present one, 0.001 s, on",
    );
    refused(advance(id, t, [0.5, 0.5, -0.1], true), BadValue, "duties[2] = -0.1 is not allowed: 0 to 1");
    refused(advance(id, t, [f64::NAN, 0.5, 0.5], true), BadValue, "duties[0] = NaN is not allowed: 0 to 1");
    refused(advance_gates(id, t, 0x30), ShootThrough, "gates = 0x30 is not allowed: both gates of leg c are on");
    refused(advance_gates(id, t, 0x100), BadValue, "gates = 0x100 is not allowed: 0 to 0x3f");
    refused(advance_gates(id, f64::INFINITY, 0), BadTime, "t = inf s");
    refused(advance(id, 1e9, [0.5; 3], true), Failed, "the step size = 999999999.999 s is not allowed: at most 62.5 s");
    refused(set(id, named("u_dc"), -1.0), BadValue, "u_dc = -1 is not allowed: at least 0");
    refused(set(id, named("mechanics.J"), 1.0), NotSettable, "mechanics.J is a fixed parameter");
    refused(set(id, 100_000, 1.0), UnknownVariable, "variable = 100000 is not allowed: 1 to ");
    refused(find("motor.Rs"), UnknownVariable, "PmsmPlant has no variable \"motor.Rs\"");
    for (setup, text) in [
        (AdcSetup { bits: 25, ..adc_setup }, "bits = 25 is not allowed: 1 to 24"),
        (AdcSetup { current_gain: 0.0, ..adc_setup }, "current_gain = 0 is not allowed: finite and not 0"),
        (AdcSetup { voltage_gain: f64::NAN, ..adc_setup }, "voltage_gain = NaN"),
        (AdcSetup { current_offset: f64::INFINITY, ..adc_setup }, "current_offset = inf"),
        (AdcSetup { sensors: 3, ..adc_setup }, "sensors = 3 is not allowed: 0 (in the phases), 1 (below the legs)"),
    ] {
        refused(set_adc(id, setup), BadValue, text);
    }
    assert_eq!(get_adc(id).unwrap(), adc_setup);
    refused(
        set_encoder(id, EncoderSetup { counts: 4095, offset: 0.0 }),
        BadValue,
        "counts = 4095 is not allowed: a multiple of 4",
    );
    refused(set_encoder(id, EncoderSetup { counts: 4096, offset: f64::NAN }), BadValue, "offset = NaN");
    refused(checked(vm_set_hall(id, f64::INFINITY)), BadValue, "offset = inf is not allowed: a finite number");
    assert_eq!((values(id), time(id).unwrap().to_bits()), (before, 0.001_f64.to_bits()));
    destroy(id).unwrap();
}

#[test]
fn parameters_that_contradict_each_other_are_refused_until_they_agree() {
    let id = create().unwrap();
    set(id, named("inverter.pulse_min"), 1e-4).unwrap();
    let before = values(id);
    for _ in 0..2 {
        let text = "inverter.pulse_min = 0.0001 s is not allowed: at most half of inverter.T_pwm = 0.0001 s";
        refused(advance(id, T, [0.5; 3], true), Inconsistent, text);
        assert_eq!(values(id), before);
    }
    // Not begun: a fixed parameter can still be set.
    set(id, named("inverter.pulse_min"), 0.0).unwrap();
    set(id, named("motor.L_d"), 7e-3).unwrap();
    advance(id, T, [0.5; 3], true).unwrap();
    refused(set(id, named("motor.L_d"), 7e-3), NotSettable, "before the first advance");
    destroy(id).unwrap();
}

#[test]
fn gates_terminals_and_shunts_need_the_switched_inverter() {
    let id = create().unwrap();
    set(id, named("inverter.mode"), 1.0).unwrap();
    let text = "inverter.mode = 1 (Average) is not allowed: gate signals need 2 (Switched)";
    refused(advance_gates(id, T, 0), NeedsSwitched, text);
    refused(terminals(id), NeedsSwitched, "terminals need 2 (Switched)");
    set_adc(id, AdcSetup { sensors: LINK, ..get_adc(id).unwrap() }).unwrap();
    refused(adc(id), NeedsSwitched, "shunts need 2 (Switched)");
    destroy(id).unwrap();
}

#[test]
fn a_null_pointer_is_named() {
    let id = create().unwrap();
    let mut some = MotorId::default();
    let statuses = unsafe {
        [
            (vm_create(null_mut()), "motor"),
            (vm_create_from_motor_file(null(), &raw mut some), "path"),
            (vm_create_from_motor_text(c"".as_ptr(), null_mut()), "motor"),
            (vm_create_from_preset(null(), &raw mut some), "json"),
            (vm_find(null(), null_mut()), "variable"),
            (vm_find(null(), &raw mut some.index), "name"),
            (vm_get(id, 1, null_mut()), "value"),
            (vm_time(id, null_mut()), "t"),
            (vm_advance_duties(id, T, null(), 1), "duties"),
            (vm_adc(id, null_mut()), "counts"),
            (vm_encoder(id, null_mut()), "count"),
            (vm_hall(id, null_mut()), "bits"),
            (vm_terminals(id, null_mut()), "terminals"),
            (vm_get_adc(id, null_mut()), "setup"),
            (vm_set_adc(id, null()), "setup"),
            (vm_get_encoder(id, null_mut()), "setup"),
            (vm_set_encoder(id, null()), "setup"),
        ]
    };
    for (status, name) in statuses {
        // The text is that of the last call: each of them has the same code.
        assert_eq!(status, NullPointer as i32, "{name}");
    }
    assert_eq!(error_text(), "setup = NULL is not allowed: a pointer that is not NULL");
    assert_eq!(unsafe { vm_find(null(), &raw mut some.index) }, NullPointer as i32);
    assert_eq!(error_text(), "name = NULL is not allowed: a pointer that is not NULL");
    assert_eq!((some, time(id).unwrap().to_bits()), (MotorId::default(), 0));
    let wrong = unsafe { vm_find(c"\xff".as_ptr(), &raw mut some.index) };
    assert_eq!((wrong, error_text().starts_with("name is not a text in UTF-8")), (BadValue as i32, true));
    destroy(id).unwrap();
}

#[test]
fn texts_fit_into_any_room() {
    assert_eq!(find("x").unwrap_err().0, UnknownVariable as i32);
    let whole = error_text();
    let mut room = [0x55_u8; 16];
    assert_eq!(unsafe { vm_error_text(room.as_mut_ptr().cast(), 8) }, whole.len());
    assert_eq!(CStr::from_bytes_until_nul(&room).unwrap().to_str().unwrap(), &whole[..7]);
    assert_eq!(room[8..], [0x55; 8]);
    assert_eq!(unsafe { vm_error_text(null_mut(), 8) }, whole.len());
    assert_eq!(unsafe { vm_error_text(room.as_mut_ptr().cast(), 0) }, whole.len());
    assert_eq!(unsafe { vm_name(named("motor.R_s"), room.as_mut_ptr().cast(), 16) }, 0);
    assert_eq!(CStr::from_bytes_until_nul(&room).unwrap(), c"motor.R_s");
}

#[test]
fn motors_come_from_files_and_presets() {
    let file = |name: &str| format!("{}/../motors/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    for entry in std::fs::read_dir(format!("{}/../motors", env!("CARGO_MANIFEST_DIR"))).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            let id = create_from_file(path.to_str().unwrap()).unwrap();
            advance(id, T, [0.5; 3], true).unwrap();
            destroy(id).unwrap();
        }
    }
    let id = create_from_file(&file("ipmsm-2.2kw")).unwrap();
    let text = std::fs::read_to_string(file("ipmsm-2.2kw")).unwrap();
    let same = create_from_text(&text).unwrap();
    assert_eq!(values(id), values(same));
    let line = text.lines().find(|line| line.starts_with("R_s")).unwrap();
    let R_s: f64 = line.split(['=', '#']).nth(1).unwrap().trim().parse().unwrap();
    assert_eq!(get(id, named("motor.R_s")).unwrap().to_bits(), R_s.to_bits());
    // Full scale at 1.5 times the maximum current.
    let i_max: f64 =
        text.split_once("\ncurrent").unwrap().1.split(['=', '#', '\n']).nth(1).unwrap().trim().parse().unwrap();
    assert!((get_adc(id).unwrap().current_gain * 1.5 * i_max - 2048.0).abs() < 1e-9);
    refused(create_from_file("no/such.toml"), BadFile, "no/such.toml");
    refused(create_from_text(&text.replace("R_s", "R_S")), BadFile, "motor file:");
    let negative = text.replace(line, "R_s = -1.0");
    refused(create_from_text(&negative), BadFile, "motor.R_s of PmsmPlant = -1 must be greater than 0");
    destroy(id).unwrap();
    destroy(same).unwrap();

    let preset = |start: &str| format!("{{\"format\": \"fmu preset\", \"version\": 2, \"start\": {{{start}}}}}");
    let id = create_from_preset(&preset(r#""motor.R_s": "0.775", "flux_map.use": "false", "u_dc": "48""#)).unwrap();
    assert_eq!(get(id, named("motor.R_s")).unwrap().to_bits(), 0.775_f64.to_bits());
    assert!((get_adc(id).unwrap().voltage_gain * 1.5 * 48.0 - 4096.0).abs() < 1e-9);
    assert_eq!(get(id, named("inverter.mode")).unwrap().to_bits(), 2.0_f64.to_bits());
    destroy(id).unwrap();
    // The switched inverter excludes iron loss, which decides unless the preset does.
    for (start, mode) in [(r#""iron.G_e": "1e-3""#, 1.0), (r#""iron.G_e": "1e-3", "inverter.mode": "2""#, 2.0_f64)] {
        let id = create_from_preset(&preset(start)).unwrap();
        assert_eq!(get(id, named("inverter.mode")).unwrap().to_bits(), mode.to_bits());
        assert_eq!(advance(id, T, [0.5; 3], true).is_ok(), mode < 1.5);
        destroy(id).unwrap();
    }
    for (json, text) in [
        ("{}", "the preset is not a preset: missing field `format`"),
        (&preset(r#""motor.R": "1""#), "the preset: PmsmPlant has no variable \"motor.R\""),
        (&preset(r#""motor.R_s": "-1""#), "the preset: motor.R_s = -1 is not allowed: greater than 0"),
        (&preset(r#""motor.R_s": "x""#), "the preset: motor.R_s = \"x\" is not allowed: a number"),
        (&preset(r#""motor.R_s": "1", "motor.R_s": "2""#), "the preset: motor.R_s already has a value"),
    ] {
        refused(create_from_preset(json), BadFile, text);
    }
}

/// Each gate bit turns its switch on; a shunt sees its leg only while the leg is at the lower rail.
#[test]
fn bits_gates_and_shunts_belong_together() {
    let id = create().unwrap();
    set_adc(id, AdcSetup { sensors: LOW_SIDE, ..get_adc(id).unwrap() }).unwrap();
    for bit in 0..6_u32 {
        let t = time(id).unwrap() + 1e-6;
        advance_gates(id, t, 1 << bit).unwrap();
        let (leg, lower) = (bit / 2, bit % 2 == 1);
        let read = terminals(id).unwrap();
        assert_eq!(if lower { read.lower } else { read.upper }, 1 << leg, "gate {bit}: {read:?}");
        assert!((read.u[leg as usize] - if lower { 0.0 } else { 325.0 }).abs() < 1e-9, "gate {bit}: {read:?}");
    }
    // a to the upper rail, b and c to the lower one: 2/3 u_dc over 6 mH.
    let t = time(id).unwrap() + 100e-6;
    advance_gates(id, t, 0x29).unwrap();
    let i = [get(id, named("i_a")).unwrap(), get(id, named("i_b")).unwrap()];
    assert!((i[0] - 3.6).abs() < 0.1 && (i[1] + 1.8).abs() < 0.05, "{i:?}");
    let setup = get_adc(id).unwrap();
    let ampere = |count: u32| (f64::from(count) - setup.current_offset) / setup.current_gain;
    let near = |count: u32, i: f64| assert!((ampere(count) - i).abs() < 0.51 / setup.current_gain, "{count}: {i} A");
    let counts = adc(id).unwrap();
    near(counts.i[0], 0.0);
    near(counts.i[1], i[1]);
    near(counts.i[2], i[1]);
    set_adc(id, AdcSetup { sensors: LINK, ..setup }).unwrap();
    near(adc(id).unwrap().i[0], i[0]);
    set_adc(id, AdcSetup { sensors: 0, current_gain: -setup.current_gain, ..setup }).unwrap();
    near(adc(id).unwrap().i[0], -i[0]);
    assert_eq!(hall(id).unwrap(), 5);
    checked(vm_set_hall(id, 0.1)).unwrap();
    assert_eq!(hall(id).unwrap(), 4);
    destroy(id).unwrap();
}

/// Motors of several threads do not disturb each other, and the calls of two threads on one motor take place in turn.
#[test]
fn threads_share_the_pool() {
    let run = |seed: u32| {
        let id = create().unwrap();
        for k in 1..=400_u32 {
            let d = 0.4 + 0.001 * f64::from((k * seed) % 200);
            advance(id, T * f64::from(k), [d, 0.5, 1.0 - d], true).unwrap();
        }
        let found = values(id);
        destroy(id).unwrap();
        found
    };
    let alone: Vec<_> = (1..=8).map(run).collect();
    let together: Vec<_> = std::thread::scope(|scope| {
        let threads: Vec<_> = (1..=8).map(|seed| scope.spawn(move || run(seed))).collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    });
    assert_eq!(alone, together);
    assert_ne!(alone[0], alone[1]);
    let id = create().unwrap();
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for k in 0..500_u32 {
                    match advance(id, 1e-6 * f64::from(k), [0.5; 3], true) {
                        Ok(()) => {}
                        Err((code, _)) => assert_eq!(code, BadTime as i32),
                    }
                }
            });
        }
    });
    assert!((time(id).unwrap() - 499e-6).abs() < 1e-15);
    destroy(id).unwrap();
    refused(time(id), BadId, "no motor has this id, or it was destroyed");
    refused(time(MotorId::default()), BadId, "motor = {0, 0} is not allowed: it is the null id");
}

/// The number of motors is limited. Alone in its process: other tests would lack the places.
#[test]
#[ignore = "the next test runs it in a separate process"]
fn the_pool_is_full() {
    let all: Vec<MotorId> = (0..MOST).map(|_| create().unwrap()).collect();
    refused(create(), TooMany, "there are 256 motors, the maximum number: destroy one first");
    destroy(all[100]).unwrap();
    let next = create().unwrap();
    assert_eq!((next.index, next.generation), (all[100].index, all[100].generation + 1));
    assert_eq!((vm_is_valid(all[100]), vm_is_valid(next)), (0, 1));
    for id in all.into_iter().filter(|id| id.index != next.index) {
        destroy(id).unwrap();
    }
    destroy(next).unwrap();
}

#[test]
fn the_pool_has_a_limit() {
    let mut test = std::process::Command::new(std::env::current_exe().unwrap());
    let output = test.args(["--ignored", "--exact", "the_pool_is_full"]).output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}
