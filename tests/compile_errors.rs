//! The compiler's messages about contradictory rows and models: Cargo builds a separate crate for each.
#![allow(missing_docs)]

use std::fs;
use std::path::Path;
use std::process::Command;

/// A wrong program: its name, its source, the text of the error, and its line.
struct Wrong {
    name: &'static str,
    source: String,
    why: &'static str,
    line: usize,
}

/// A table with a wrong row.
fn row(name: &'static str, row: &str, why: &'static str, line: usize) -> Wrong {
    let source = format!(
        "use fmu_core::{{Row, Table, table, unit::VOLT}};\n\
         struct M {{ u: f64, on: bool, a: [f64; 4], t: String, f: f32 }} type V = Row<M>;\n\
         const TABLE: &Table<M> = table![\n    V::input(\"u\", &VOLT, \"\", |m| &mut m.u),\n    \
         {row},\n];\nfn main() {{ let _ = TABLE.len(); }}\n"
    );
    Wrong { name, source, why, line }
}

/// A model that is exported with the first text of `change` replaced by the second.
fn model(name: &'static str, change: (&str, &str), why: &'static str, line: usize) -> Wrong {
    const RIGHT: &str = r#"use fmu_core::*;
use fmu_core::unit::*;
#[derive(Clone, Default, serde::Serialize, serde::Deserialize)]
struct Ball { h: f64, v: f64, a: [f64; 2] }
type V = Row<Block<Ball>>;
impl Model for Ball {
    type Outputs = ();
    const INFO: Info = Info { name: "Ball", ..Info::DEFAULT };
    const TABLE: &'static Table<Block<Self>> = table![
        V::state("h", &METER, "", |m| &mut m.model.h),
        V::discrete_local("v", &METER_PER_S, "", |m| &mut m.model.v),
        V::array_local("a", &METER, "", 2, |m| &mut m.model.a),
    ];
    fn initialize(&mut self) {}
    fn output(&self, _: Elapsed, (): &mut ()) {}
    fn advance(&mut self, step: &Step) -> Result<(), Fault> {
        integrate::smooth::<Self, 1>(self, step, 1.0)
    }
}
impl ContinuousTime for Ball {
    const STATES: &'static [State<Self>] = &[
        State::new("h", &METER_PER_S, |m| &mut m.h),
    ];
    fn derivatives(&self, _: Elapsed, dx: &mut [f64]) -> Result<(), Fault> { dx[0] = self.v; Ok(()) }
}
fmu_export::export!(Ball: ContinuousTime);
fn main() {}
"#;
    assert!(RIGHT.contains(change.0), "{name}");
    Wrong { name, source: RIGHT.replacen(change.0, change.1, 1), why, line }
}

/// An enumeration and the code after it.
fn enumeration(name: &'static str, derive: &str, rest: &str, why: &'static str, line: usize) -> Wrong {
    let body = "enum Fan(\"FanMode\", \"\") {\n1 Off \"Stands\";\n2 On \"Turns\";\n}";
    let source = format!("fmu_core::enumeration! {{\n{derive}\n{body}\n}}\n{rest}\n");
    Wrong { name, source, why, line }
}

/// Tables with a wrong row.
fn rows() -> Vec<Wrong> {
    vec![
        row(
            "bound",
            r#"V::boolean_input("on", "", |m| &mut m.on).at_least(0.0)"#,
            "on: only a number can have a bound",
            5,
        ),
        row(
            "empty",
            r#"V::output("x", &VOLT, "", |m| &mut m.u).above(1.0).at_most(1.0)"#,
            "x: the bounds leave no value",
            5,
        ),
        row(
            "shape",
            r#"V::array_input("a", &VOLT, "", 4, |m| &mut m.a).shape(&[2, 3])"#,
            "a: the product of the extents",
            5,
        ),
        row(
            "tuned",
            r#"V::text_parameter("t", "", |m| &mut m.t).tunable()"#,
            "t: only a parameter of a type other than text",
            5,
        ),
        row(
            "inner",
            r#"V::discrete_input("x", &VOLT, "", |m| &mut m.u).intermediate()"#,
            "x: only a continuous input or output can be intermediate",
            5,
        ),
        row(
            "started",
            r#"V::parameter("x", &VOLT, "", |m| &mut m.u).exact()"#,
            "x: only an output or a local variable can be exact",
            5,
        ),
        row(
            "constant",
            r#"V::output("x", &VOLT, "", |m| &mut m.u).as_output()"#,
            "x: only a constant can be made an output",
            5,
        ),
        row(
            "unnamed_alias",
            r#"V::output("x", &VOLT, "", |m| &mut m.u).aliases(&[fmu_core::Alias { name: "", description: "", display: None }])"#,
            "x: an alias needs its own name",
            5,
        ),
        row(
            "own_alias",
            r#"V::output("x", &VOLT, "", |m| &mut m.u).aliases(&[fmu_core::Alias { name: "x", description: "", display: None }])"#,
            "x: an alias needs its own name",
            5,
        ),
        row(
            "shown_alias",
            r#"V::boolean_output("x", "", |m| &mut m.on).aliases(&[
            fmu_core::Alias { name: "x_rpm", description: "", display: Some(fmu_core::unit::RPM) }])"#,
            "x_rpm: only a real variable with a unit can have a display unit",
            5,
        ),
        row("mean", r#"V::float32_output("f", &VOLT, "", |m| &mut m.f).mean()"#, "f: only a real output", 5),
        row(
            "blank",
            r#"V::output("coil.loss [W]", &VOLT, "", |m| &mut m.u)"#,
            "coil.loss [W]: not a structured name of FMI: letters of ASCII, digits and _ in parts with dots; write coil.'loss [W]'",
            5,
        ),
        row(
            "umlaut",
            r#"V::output("Wärme", &VOLT, "", |m| &mut m.u)"#,
            "Wärme: not a structured name of FMI: letters of ASCII, digits and _ in parts with dots; put other characters of ASCII",
            5,
        ),
        row("place", r#"V::uint8_input("on", "", |m| &mut m.on)"#, "mismatched types", 5),
        // These two are reported at the table, which starts in line 3.
        row("twice", r#"V::boolean_input("u", "", |m| &mut m.on)"#, "u: two rows of the table have this name", 3),
        row("empty_array", r#"V::array_input("a", &VOLT, "", 0, |m| &mut m.a)"#, "a: an array needs an element", 3),
    ]
}

/// Wrong models and enumerations.
fn models() -> Vec<Wrong> {
    const EXPORT: usize = 26;
    let state = |wrong: &'static str| ("State::new(\"h\"", wrong);
    vec![
        model("hyphen", (r#"name: "Ball""#, r#"name: "My-Ball""#), "My-Ball: INFO.name must be a C identifier", EXPORT),
        model("digit", (r#"name: "Ball""#, r#"name: "2Balls""#), "2Balls: INFO.name must be a C identifier", EXPORT),
        model("nameless", (r#"name: "Ball", "#, ""), ": INFO.name must be a C identifier", EXPORT),
        model("typo", state("State::new(\"hight\""), "STATES of Ball: no row of the table has the name hight", EXPORT),
        model("sampled", state("State::new(\"v\""), "v: the row of a state is V::output or V::state", EXPORT),
        model("array", state("State::new(\"a\""), "a: the row is an array: its state is State::array", EXPORT),
        model(
            "double",
            (
                "        State::new(\"h\"",
                "        State::new(\"h\", &METER_PER_S, |m| &mut m.h),\n        State::new(\"h\"",
            ),
            "h: two states have this name",
            EXPORT + 1,
        ),
        model("number", ("<Self, 1>", "<Self, 12>"), "the above error was encountered while instantiating", 17),
        model(
            "events_number",
            (
                "integrate::smooth::<Self, 1>(self, step, 1.0)\n    }\n}",
                "integrate::hybrid::<Self, 13>(self, step, 1.0)\n    }\n}\nimpl Events for Ball {\n    \
                 fn event(&mut self, _: Elapsed) -> Result<Outcome, Fault> { Ok(Outcome::default()) }\n    \
                 fn next(&self, _: Elapsed) -> Next { Next::Never }\n}",
            ),
            "the above error was encountered while instantiating",
            17,
        ),
        model(
            "unserialized",
            ("serde::Serialize, serde::Deserialize)]\nstruct Ball", "serde::Deserialize)]\nstruct Ball"),
            "`Ball` cannot be stored: a stored state is a clone in bytes",
            EXPORT,
        ),
        model(
            "uncloned",
            ("Clone, Default, serde::Serialize, serde::Deserialize)]\nstruct Ball", "Default)]\nstruct Ball"),
            "lacks `Clone`, `Serialize` or `Deserialize`",
            EXPORT,
        ),
        model("unmodeled", ("export!(Ball: ContinuousTime)", "export!(f64)"), "`f64` is not a model", EXPORT),
        model(
            "inside",
            ("Ball: ContinuousTime", "Ball: ContinuousTime + Intermediate"),
            "`Ball` has no intermediate updates",
            EXPORT,
        ),
        model(
            "unnamed",
            (
                r#"V::state("h","#,
                "V::output(\"y\", &METER, \"\", |m| &mut m.model.v).intermediate(),\n        V::state(\"h\",",
            ),
            "Ball: a row of the table with .intermediate() needs the capability Intermediate",
            EXPORT + 1,
        ),
        model(
            "stops",
            ("Ball: ContinuousTime", "Ball: ContinuousTime + EventMode"),
            "`Ball` does not stop at its events",
            EXPORT,
        ),
        model(
            "eventless",
            (
                "Ball: ContinuousTime);",
                "Ball: ContinuousTime + EventMode);\nimpl Events for Ball {\n    \
                 fn event(&mut self, _: Elapsed) -> Result<Outcome, Fault> { Ok(Outcome::default()) }\n    \
                 fn next(&self, _: Elapsed) -> Next { Next::Never }\n}\nimpl EventMode for Ball {\n    \
                 fn to_event(&mut self, _: &Step) -> Result<Stop, Fault> { unreachable!() }\n}",
            ),
            "Ball: EventMode is for a model that is exported with ContinuousTime and Events",
            EXPORT,
        ),
        model(
            "tolerance",
            (
                r#"name: "Ball","#,
                r#"name: "Ball", experiment: Experiment { tolerance: Some(0.0), ..Experiment::DEFAULT },"#,
            ),
            "Ball: the tolerance of the experiment must be greater than 0",
            EXPORT,
        ),
        model(
            "category",
            (r#"name: "Ball","#, r#"name: "Ball", categories: &[("logEvents", "")],"#),
            "logEvents: two log categories have this name",
            EXPORT,
        ),
        model("events", ("Ball: ContinuousTime", "Ball: ContinuousTime + Events"), "`Ball` has no events", EXPORT),
        enumeration("unmarked", "#[derive(Default)]", "fn main() {}", "no `#[default]`", 2),
        enumeration("start", "", "#[derive(Default)]\nstruct M { fan: Fan }", "`Fan: Default` is not satisfied", 9),
    ]
}

/// Structural parameters and arrays of states.
fn sizes() -> Vec<Wrong> {
    const EXPORT: usize = 26;
    let array = |wrong: &'static str| ("State::new(\"h\", &METER_PER_S, |m| &mut m.h)", wrong);
    let structural = |wrong: &'static str| ("V::state(\"h\",", wrong);
    vec![
        row(
            "endless",
            r#"V::structural("n", "", |_| unreachable!())"#,
            "n: a structural parameter needs an upper bound: at_most",
            3,
        ),
        row(
            "unknown_size",
            r#"V::array_input("a", &VOLT, "", 4, |m| &mut m.a).sized(&["n"])"#,
            "a: the table has no structural parameter of the name that sizes it",
            3,
        ),
        row(
            "wrong_size",
            r#"V::structural("n", "", |_| unreachable!()).at_most(3.0),
               V::array_input("a", &VOLT, "", 4, |m| &mut m.a).sized(&["n"])"#,
            "a: the product of the maximum sizes is not the number of elements",
            3,
        ),
        row(
            "sized_scalar",
            r#"V::input("x", &VOLT, "", |m| &mut m.u).sized(&["n"])"#,
            "x: only an array without a shape",
            5,
        ),
        model(
            "longer",
            array("State::array(\"a\", &METER_PER_S, 3, |m| &mut m.a)"),
            "a: State::array and its row have different numbers of elements",
            EXPORT,
        ),
        model(
            "sizeless",
            ("Ball: ContinuousTime", "Ball: ContinuousTime + Resizable"),
            "`Ball` has no structural parameters",
            EXPORT,
        ),
        model(
            "unsized",
            structural("V::structural(\"n\", \"\", |_| unreachable!()).at_most(2.0),\n        V::state(\"h\","),
            "Ball: a row V::structural needs the capability Resizable",
            EXPORT + 1,
        ),
    ]
}

/// Clocks.
fn clocks() -> Vec<Wrong> {
    const EXPORT: usize = 26;
    let unranked = model(
        "unranked",
        (r#"V::state("h","#, "V::clock(\"c\", \"\", Clock::triggered()),\n        V::state(\"h\","),
        "c: a clock of Scheduled Execution needs a priority",
        EXPORT + 1,
    );
    let export = (
        "Ball: ContinuousTime);",
        "Ball: ContinuousTime + Clocked + ScheduledExecution);\nimpl Clocked for Ball {\n    \
         fn tick(&mut self, _: usize, _: Elapsed) -> Result<(), Fault> { Ok(()) }\n}",
    );
    vec![
        row(
            "still",
            r#"V::clock("c", "", fmu_core::Clock::constant(0.0))"#,
            "c: the interval of a clock is greater than 0",
            5,
        ),
        row(
            "moved",
            r#"V::clock("c", "", fmu_core::Clock::triggered()).shift(1.0)"#,
            "c: only a clock with a period",
            5,
        ),
        row(
            "unmoved",
            r#"V::parameter("x", &VOLT, "", |m| &mut m.u).on("c")"#,
            "x: only a variable that changes can be on a clock",
            5,
        ),
        model("tickless", ("Ball: ContinuousTime", "Ball: ContinuousTime + Clocked"), "`Ball` has no clocks", EXPORT),
        model(
            "unticked",
            (r#"V::state("h","#, "V::clock(\"c\", \"\", Clock::triggered()),\n        V::state(\"h\","),
            "Ball: a row V::clock needs the capability Clocked",
            EXPORT + 1,
        ),
        model(
            "unscheduled",
            ("Ball: ContinuousTime", "Ball: ContinuousTime + ScheduledExecution"),
            "`Ball` has no clocks",
            EXPORT,
        ),
        Wrong {
            name: "unsaved_clock",
            source: unranked.source.replace(
                export.0,
                &export
                    .1
                    .replace("ContinuousTime + Clocked + ScheduledExecution", "Unsaved + ContinuousTime + Clocked"),
            ),
            why: "Ball: Clocked needs a model that is saved, not Unsaved",
            line: EXPORT + 1,
        },
        Wrong { source: unranked.source.replace(export.0, export.1), ..unranked },
        model(
            "adrift",
            (
                r#"V::state("h","#,
                "V::output(\"y\", &METER, \"\", |m| &mut m.model.v).on(\"c\"),\n        V::state(\"h\",",
            ),
            "y: the table has no clock of the name that it is on",
            EXPORT + 1,
        ),
    ]
}

#[test]
fn a_wrong_row_or_model_is_an_error_at_its_place() {
    let cases: Vec<Wrong> = rows().into_iter().chain(models()).chain(clocks()).chain(sizes()).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("compile_errors");
    let sources = folder.join("src/bin");
    fs::create_dir_all(&sources).unwrap();
    let crates = ["fmu-core", "fmu-export"].map(|name| format!("{name} = {{ path = {:?} }}\n", root.join(name)));
    let manifest = format!(
        "[workspace]\n[package]\nname = \"wrong\"\nedition = \"2024\"\n[profile.dev]\ndebug = 0\n[dependencies]\n{}\
         serde = {{ version = \"1\", features = [\"derive\"] }}\n",
        crates.concat()
    );
    fs::write(folder.join("Cargo.toml"), manifest).unwrap();
    fs::copy(root.join("Cargo.lock"), folder.join("Cargo.lock")).unwrap();
    for wrong in &cases {
        fs::write(sources.join(format!("{}.rs", wrong.name)), &wrong.source).unwrap();
    }
    // The number of states is checked only when code is generated.
    let build = |arguments: &[&str]| {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(["build", "--offline"]).args(arguments).current_dir(&folder);
        let output = cargo.env("CARGO_TARGET_DIR", folder.join("target")).output().unwrap();
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let said = build(&["--keep-going", "--message-format", "short"]);
    assert!(said.contains("STATES of Ball has the length 1, and its integrator is made for 12"), "{said}");
    for Wrong { name, why, line, .. } in cases {
        let place = Path::new("src/bin").join(format!("{name}.rs:{line}:")).display().to_string();
        assert!(said.lines().any(|l| l.starts_with(&place) && l.contains(why)), "{place} {why}: {said}");
    }
    // The compiler's long form suggests no other trait.
    let said = build(&["--bin", "events"]);
    assert!(said.contains("`Ball` has no events") && !said.contains("Sampled"), "{said}");
}
