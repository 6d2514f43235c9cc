//! The description of an FMU of either standard, or its terminals and icons.

use fmu_import::Values;
use model_description::{Element, read, read_terminals};

pub(crate) fn run(bytes: &[u8]) {
    if let Ok(md) = read(bytes) {
        for v in &md.variables {
            std::hint::black_box((md.shape(v), md.measured(v), md.state_of(v), md.display_unit(v, None)));
            let _ = Values::read("1 2.5 true x", v, &md);
            assert!(md.variable(&v.name).is_some(), "{}", v.name);
        }
        std::hint::black_box(md.states());
    }
    if let Some(root) = std::str::from_utf8(bytes).ok().and_then(|text| Element::parse(text).ok()) {
        // An element that is written is read again.
        let xml = root.to_xml();
        let again = Element::parse(&xml).expect("XML as we write it").to_xml();
        assert_eq!(again, xml);
    }
    if let Ok(terminals) = read_terminals(bytes) {
        std::hint::black_box(terminals.terminal("a.b"));
    }
}
