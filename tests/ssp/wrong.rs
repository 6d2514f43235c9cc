//! Wrong files: the messages name file, line and remedy, and each thing once.

use super::*;

#[test]
fn a_wrong_structure_is_told_with_file_line_and_remedy() {
    let connection = |to: &str| {
        format!("startElement=\"controller\" startConnector=\"u_a\" endElement=\"plant\" endConnector=\"{to}\"")
    };
    let good = connection("u_a");
    for (old, new, parts) in [
        (&*good, connection("u_x"), &["plant has no connector u_x; it has u_a, u_b"][..]),
        (
            &*good,
            connection("i_a"),
            &["connects controller.u_a (output) with plant.i_a (output): expected an output and an input"],
        ),
        (&*good, connection("u_b"), &["plant.u_b is fed twice: remove one of the connections"]),
        (
            "startConnector=\"enabled\" endConnector=\"enabled\"",
            "startConnector=\"enabled\" endConnector=\"lock_lost\"".into(),
            &["the output lock_lost is connected twice: remove one of the connections"],
        ),
        (
            &*good,
            good.replace("\"plant\"", "\"motor\""),
            &["there is no component motor; available: controller, plant"],
        ),
        (
            "source=\"resources/PmsmPlant.fmu\"",
            "source=\"resources/Motor.fmu\"".into(),
            &["has no resources/Motor.fmu"],
        ),
    ] {
        let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", old, &new);
        let place = if new.contains("Motor.fmu") { "x.ssp: " } else { "x.ssp: SystemStructure.ssd: line " };
        fails(&["simulate", &path], 2, &[&[path.as_str(), place], parts].concat());
    }
    let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", "</ssd:System>", "</ssd:Systm>");
    fails(&["simulate", &path], 2, &["x.ssp: SystemStructure.ssd: line", "not well-formed XML"]);
    let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", "unit=\"rad/s\"", "unit=\"rpm\"");
    let output = fmu(&["simulate", &path, "--stop", "0.001"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && said.contains("and rpm has no BaseUnit: the number passes unchanged"), "{said}");
    for (base, cause) in
        [("rad=\"1\" s=\"-1\" factor=\"0.1047\"", ""), ("m=\"1\"", "the source is in rpm = m, the target in rad/s")]
    {
        let units = format!("<ssd:Units><ssc:Unit name=\"rpm\"><ssc:BaseUnit {base}/></ssc:Unit>");
        let (_defined, path) = changed(&path, "SystemStructure.ssd", "<ssd:Units>", &units);
        if cause.is_empty() {
            done(&["simulate", &path, "--stop", "0.001"]);
        } else {
            fails(&["simulate", &path], 2, &["x.ssp: ", ": line ", cause]);
        }
    }
    let (old, new) = ("implementation=\"CoSimulation\"", "implementation=\"ModelExchange\"");
    let (_dir, path) = changed(&ssp("fmi2.ssp"), "SystemStructure.ssd", old, new);
    fails(
        &["simulate", &path],
        2,
        &["x.ssp: SystemStructure.ssd: line", "is not Co-Simulation: simulate it with --me"],
    );
    let plain = folder().join("plain.ssp");
    std::fs::write(&plain, "hello").unwrap();
    fails(&["simulate", plain.to_str().unwrap()], 2, &["plain.ssp: not a ZIP archive"]);
    let fmu = common::archives().join("fmi2/PmsmPlant.fmu").display().to_string();
    fails(&["simulate", &ssp("fmi2.ssp"), &fmu], 2, &["fmi2.ssp: an SSP file cannot be combined with other files"]);
    fails(
        &["simulate", &ssp("fmi2.ssp"), "--input", "speed_rev=1"],
        2,
        &["--input speed_rev=1: is not an input of the system", "speed_ref"],
    );
}

#[test]
fn wrong_values_are_told_with_file_line_and_remedy() {
    let parameters = |old: &str, new: &str| {
        let text = entry(&ssp("motor.ssp"), "resources/plant.ssv");
        assert!(text.contains(old), "{old}");
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("p.ssv");
        std::fs::write(&path, text.replacen(old, new, 1)).unwrap();
        (dir, path.to_str().unwrap().to_owned())
    };
    let out = folder().join("never.ssp");
    let out = out.to_str().unwrap();
    let fmus = common::archives().to_str().unwrap();
    for (old, new, status, part) in [
        ("motor.R_s", "motor.R", 2, "PmsmPlant has no variable motor.R: correct the name, or remove the parameter"),
        ("value=\"3.6\"", "value=\"3.6\" unit=\"mOhm\"", 2, "motor.R_s is given in mOhm, but PmsmPlant uses Ohm"),
        ("value=\"3.6\"", "value=\"much\"", 2, "motor.R_s = much"),
        ("value=\"3.6\"", "value=\"-1\"", 1, "motor.R_s = -1 is not allowed"),
    ] {
        let (_dir, path) = parameters(old, new);
        let arguments = ["ssp", "--fmus", fmus, "--parameters", &format!("plant={path}"), "--out", out];
        fails(&arguments, status, &["p.ssv: line ", part]);
    }
    let (_dir, path) = parameters("motor.R_s", "motor.R_s");
    fails(
        &["ssp", "--fmus", fmus, "--parameters", &format!("p={path}"), "--out", out],
        2,
        &["no component p; available: controller, plant"],
    );
    fails(&["ssp", "--parameters", "plant=nothing.ssv", "--out", out], 2, &["nothing.ssv: No such file"]);
    let dir = tempfile::tempdir().unwrap();
    let motor = dir.path().join("m.toml");
    let text = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/motors/reference.toml")).unwrap();
    std::fs::write(&motor, text.replacen("R_s", "R", 1)).unwrap();
    fails(&["ssp", "--motor", motor.to_str().unwrap(), "--out", out], 2, &["m.toml:7:1: unknown field `R`", "R_s"]);
    assert!(!Path::new(out).exists());
    // In an SSP a value for an unknown name is ignored (SSP 1.0) with a note; a wrong value is an error.
    let (_dir, path) = changed(&ssp("motor.ssp"), "resources/plant.ssv", "motor.R_s", "motor.R");
    let output = fmu(&["simulate", &path, "--stop", "0.001"]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        output.status.success()
            && said.contains("resources/plant.ssv: line ")
            && said.contains("there is no plant.motor.R; the value is ignored"),
        "{said}"
    );
    let (_dir, path) = changed(&ssp("motor.ssp"), "resources/plant.ssv", "value=\"3.6\"", "value=\"-1\"");
    fails(
        &["simulate", &path, "--stop", "0.001"],
        1,
        &["x.ssp: resources/plant.ssv: line ", "motor.R_s = -1 is not allowed"],
    );
}

/// A name repeated in a message, as in `--record x: x: is no variable`.
fn repeated(message: &str) -> Option<&str> {
    let parts: Vec<&str> = message.split(": ").collect();
    let ends = |before: &str, name: &str| {
        let last = before.rsplit(' ').next().unwrap_or(before);
        before == name || last == name || last.split('=').next() == Some(name)
    };
    parts.windows(2).find(|pair| ends(pair[0], pair[1])).map(|pair| pair[1])
}

/// Bad input of every kind, in commands that name variables, files and lines.
#[test]
fn no_message_names_a_thing_twice() {
    assert_eq!(repeated("error: --record x: x: is no variable"), Some("x"));
    assert_eq!(repeated("error: --input x=0:1: x: is fed twice"), Some("x"));
    assert_eq!(repeated("error: a.ssp: line 3: b: is no a"), None);
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = dir.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let plant = common::archives().join("fmi3/PmsmPlant.fmu").display().to_string();
    let system = ssp("fmi3.ssp");
    let csv = |name: &str, text: &str| file(name, text);
    let sweep = |name: &str, rest: &str| file(name, &format!("fmus = [{plant:?}]\nstop = 0.001\n{rest}"));
    let measure = "[measure]\na = { of = 'speed', is = 'final' }\n";
    let unknown_column = csv("unknown.csv", "time,speedy\n0,1\n");
    let wrong_cell = csv("cell.csv", "time,u_dc\n0,much\n");
    let no_time = csv("time.csv", "speed\n1\n");
    let values = csv(
        "values.ssv",
        "<ParameterSet><Parameters><Parameter name='no'><Real value='1'/></Parameter></Parameters></ParameterSet>",
    );
    let nothing = dir.path().join("nothing.fmu").display().to_string();
    let out = dir.path().join("out").display().to_string();
    let plain = file("plain.fmu", "hello");
    let table: Vec<(Vec<String>, &str)> = [
        (vec!["simulate", &plant, "--record", "speedy"], "speedy"),
        (vec!["simulate", &plant, "--record", "PmsmPlant.speedy"], "speedy"),
        (vec!["simulate", &plant, "--record", "q*"], "q*"),
        (vec!["simulate", &plant, "--input", "speedy=1"], "speedy"),
        (vec!["simulate", &plant, "--input", "speed=1"], "is not an input"),
        (vec!["simulate", &plant, "--input", "u_dc=much"], "much"),
        (vec!["simulate", &plant, "--input", "u_dc=0:1", "--input", "u_dc=0:2"], "is fed twice"),
        (vec!["simulate", &plant, "--input", &unknown_column], "speedy"),
        (vec!["simulate", &plant, "--input", &wrong_cell], "much"),
        (vec!["simulate", &plant, "--input", &no_time], "time.csv"),
        (vec!["simulate", &plant, "--set", "speedy=1"], "speedy"),
        (vec!["simulate", &plant, "--set", "motor.R_s=much"], "motor.R_s"),
        (vec!["simulate", &plant, "--set", "motor.R_s=-1"], "motor.R_s"),
        (vec!["simulate", &plant, "--connect", "speed=speedy"], "speedy"),
        (vec!["simulate", &plant, "--connect", "u_dc=u_a"], "is not an output"),
        (vec!["simulate", &plant, "--terminal", "a.b=c.d"], "a.b"),
        (vec!["simulate", &plant, "--parameters", &format!("PmsmPlant={values}")], "values.ssv"),
        (vec!["simulate", &plant, "--parameters", &values], "values.ssv: line"),
        (vec!["simulate", &nothing], "nothing.fmu"),
        (vec!["simulate", &plain], "plain.fmu"),
        (vec!["simulate", &system, "--record", "speedy"], "speedy"),
        (vec!["simulate", &system, "--record", "plant.speedy"], "speedy"),
        (vec!["simulate", &system, "--input", "speedy=1"], "speedy"),
        (vec!["simulate", &system, "--set", "u_dc=much"], "much"),
        (vec!["simulate", &format!("{system}#B.ssd")], "B.ssd"),
        (
            vec![
                "sweep",
                &sweep(
                    "a.toml",
                    &format!("design = {{ kind = 'grid' }}\n[vary]\nspeedy = {{ values = [1] }}\n{measure}"),
                ),
            ],
            "speedy",
        ),
        (
            vec![
                "sweep",
                &sweep(
                    "b.toml",
                    &format!("design = {{ kind = 'grid' }}\n[vary]\nspeed = {{ values = [1] }}\n{measure}"),
                ),
            ],
            "speed",
        ),
        (vec!["sweep", &sweep("c.toml", &format!("[input]\nspeedy = '1'\n{measure}"))], "speedy"),
        (vec!["sweep", &sweep("d.toml", "[measure]\na = { of = 'speedy', is = 'final' }\n")], "speedy"),
        (vec!["sweep", &sweep("e.toml", &format!("[set]\nspeedy = 1\n{measure}"))], "speedy"),
        (vec!["sweep", &sweep("f.toml", &format!("[set]\n'motor.R_s' = -1\n{measure}"))], "motor.R_s"),
        (vec!["sweep", &sweep("g.toml", &format!("conect = []\n{measure}"))], "conect"),
        (vec!["sweep", &nothing], "nothing.fmu"),
        (vec!["ssp", "--parameters", "plant=nothing.ssv", "--out", "x.ssp"], "nothing.ssv"),
        (vec!["ssp", "--fmus", "nothing", "--out", "x.ssp"], "nothing"),
        (vec!["check", &nothing], "nothing.fmu"),
        (vec!["check", &plant, "--only", "Q99"], "Q99"),
    ]
    .into_iter()
    .map(|(arguments, part)| (arguments.into_iter().map(str::to_owned).collect(), part))
    .collect();
    for (arguments, part) in table {
        let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        if arguments[0] == "sweep" {
            arguments.extend(["--out", &out]);
        }
        let output = fmu(&arguments);
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success(), "{arguments:?} succeeds");
        assert!(said.contains(part), "{arguments:?}: {part:?} is not in {said}");
        for line in said.lines() {
            assert_eq!(repeated(line), None, "{arguments:?}: {line}");
        }
    }
}
