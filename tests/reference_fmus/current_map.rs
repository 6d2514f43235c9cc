//! The example of a map as defined by FMI-LS-STRUCT: `examples/current-map`.

use super::{archive, checks, open, script};
use fmu_import::Values;
use model_description::FmiVersion::{V2, V3};
use model_description::{Causality, Dimension, Element};
use std::path::Path;

const STRUCT: &str = "org.fmi-standard.fmi-ls-struct";

/// A file of an archive.
fn text(archive: &Path, file: &str) -> Option<String> {
    let (_, files) = fmu_import::contents(archive).unwrap();
    files.get(file).map(|bytes| String::from_utf8(bytes.clone()).unwrap())
}

/// The rules of 1.0.0-rc.1 for rectilinear grids, on the packed archive.
#[test]
fn its_terminal_is_a_map() {
    let packed = archive("current-map", V3);
    let manifest = Element::parse(&text(&packed, &format!("extra/{STRUCT}/fmi-ls-manifest.xml")).unwrap()).unwrap();
    assert_eq!(manifest.name, "fmiLayeredStandardManifest");
    for (name, value) in [
        ("xmlns:fmi-ls", "http://fmi-standard.org/fmi-ls-manifest"),
        ("fmi-ls:fmi-ls-name", STRUCT),
        ("fmi-ls:fmi-ls-version", "1.0.0-rc.1"),
        ("fmi-ls:fmi-ls-description", "Layered standard for structuring of variables"),
    ] {
        assert_eq!(manifest.get(name), Some(value));
    }
    let fmu = fmu_import::Fmu::open(&packed).unwrap();
    let (md, file) = (fmu.description(), fmu.terminals().unwrap().unwrap());
    let [map] = &file.terminals[..] else { panic!("one terminal") };
    assert_eq!(map.kind, Some(format!("{STRUCT}.map.rectilinearGrid")));
    assert_eq!(map.matching_rule, format!("{STRUCT}.map"));
    let of = |kind: &str| -> Vec<_> {
        let kind = format!("{STRUCT}.map.{kind}");
        map.members.iter().filter(|m| m.kind == kind).map(|m| md.variable(&m.variable).unwrap()).collect()
    };
    let (domains, codomains) = (of("domain"), of("codomain"));
    assert_eq!((domains.len(), codomains.len(), of("domainInput").len(), of("codomainOutput").len()), (2, 2, 2, 2));
    let sizes: Vec<_> = domains.iter().map(|v| v.dimensions[0]).collect();
    for codomain in &codomains {
        assert_eq!(codomain.dimensions, sizes, "the i-th length belongs to the i-th domain");
    }
    for size in sizes {
        let Dimension::Variable(reference) = size else { panic!("a fixed size") };
        let size = md.variables.iter().find(|v| v.value_reference == reference).unwrap();
        assert_eq!(size.causality, Causality::StructuralParameter);
    }
    for pair in map.members.chunks(2) {
        let [axis, now] = pair else { unreachable!() };
        assert!(now.kind == format!("{}Input", axis.kind) || now.kind == format!("{}Output", axis.kind), "{now:?}");
        assert_eq!(md.variable(&axis.variable).unwrap().base, md.variable(&now.variable).unwrap().base);
    }
    // FMI 2.0 has no arrays, and no map.
    let old = archive("current-map", V2);
    assert_eq!(text(&old, &format!("extra/{STRUCT}/fmi-ls-manifest.xml")), None);
    assert_eq!(text(&old, "terminalsAndIcons/terminalsAndIcons.xml"), None);
}

/// A map of another size replaces the built-in one.
#[test]
fn the_map_can_be_replaced() {
    let mut it = open("current-map").instantiate("it", false).unwrap();
    let (two, three) = (Values::Integers(vec![2]), Values::Integers(vec![3]));
    it.configure(&[("map.n_d", &two), ("map.n_q", &three)]).unwrap();
    for (name, values) in [
        ("map.psi_d", &[0.0, 0.2][..]),
        ("map.psi_q", &[-0.1, 0.0, 0.1]),
        ("map.i_d", &[-50.0, -50.0, -50.0, 50.0, 50.0, 50.0]),
        ("map.i_q", &[-20.0, 0.0, 30.0, -20.0, 0.0, 30.0]),
        ("psi_d", &[0.15]),
        ("psi_q", &[0.05]),
    ] {
        it.set(name, Values::Reals(values.to_vec())).unwrap();
    }
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    it.exit_initialization().unwrap();
    let near = |found: Values, expected: f64| {
        let found = found.number().unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    };
    near(it.get("i_d").unwrap(), 25.0);
    near(it.get("i_q").unwrap(), 15.0);
    // Between the points, at the last one, and outside.
    let mut time = 0.0;
    for (flux, current) in [(-0.05, -10.0), (0.0, 0.0), (0.1, 30.0), (0.2, 60.0), (-0.2, -40.0)] {
        it.set("psi_q", Values::Reals(vec![flux])).unwrap();
        assert!(it.do_step(time, 0.1).unwrap().is_continue());
        near(it.get("i_q").unwrap(), current);
        time += 0.1;
    }
    // An axis that does not increase.
    let mut it = open("current-map").instantiate("it", false).unwrap();
    it.set("map.psi_q", Values::Reals(vec![-0.1, 0.0, 0.0, 0.1, 0.2])).unwrap();
    it.setup(0.0, None).unwrap();
    it.enter_initialization().unwrap();
    assert!(it.exit_initialization().unwrap_err().to_string().contains("map.psi_q[3] = 0 is not allowed"));
}

#[test]
fn the_checker_finds_nothing() {
    checks("current-map");
}

#[test]
fn fmpy_reads_it() {
    let said = script(
        "import sys, fmpy\n\
         from fmpy.validation import validate_fmu\n\
         assert validate_fmu(sys.argv[1]) == []\n\
         result = fmpy.simulate_fmu(sys.argv[1], start_values={'psi_d': 0.1, 'psi_q': 0.05}, stop_time=0.2)\n\
         print(result['i_d'][-1], result['i_q'][-1] > 10)\n",
        &[&archive("current-map", V3)],
    );
    assert_eq!(said.trim(), "0.0 True");
}
