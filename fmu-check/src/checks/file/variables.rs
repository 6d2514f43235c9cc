//! Variables, types and units (FMI 2.0.5, 2.2.2, 2.2.3, 2.2.7; FMI 3.0.2, 2.4.3, 2.4.4, 2.4.7).

use crate::check::{Check, Levels, Run, Verdict};
use crate::checks::file::shared::clock_rules::{
    intervals, kinds, long_intervals, names_of_types, references as references_of_clocks, reinit,
};
use crate::checks::file::shared::clocked::alias_units;
use crate::checks::file::shared::names::grammar;
use crate::checks::file::shared::type_rules::{bases, definitions, displays, each, types, unique_units, unit_names};
use crate::checks::file::xml::with_description;
use crate::fmu_file::FmuFile;
use crate::level::Level;
use model_description::{
    BaseType, Causality, Dimension, FmiVersion, Initial, ModelVariable, Variability, parse_number,
};
use std::collections::HashMap;

const TABLE: &str = "2.0.5, 2.2.7; 3.0.2, 2.4.7.4";

#[rustfmt::skip]
pub(crate) const CHECKS: &[Check] = &[
    Check { id: "V01a", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::MUST, run: Run::File(names),
        requirement: "Names of variables and aliases are unique, not empty, and free of line breaks and tabs.",
        tried: "Compares the names of all variables and aliases.", fix: "Make names unique, for example with the path of the component." },
    Check { id: "V01b", clause: "2.0.5, 2.2.9; 3.0.2, 2.4.7.5.1", levels: Levels::MUST, run: Run::File(structured),
        requirement: "With the naming convention \"structured\", every name follows the grammar.",
        tried: "Parses every name if variableNamingConvention is structured.",
        fix: "Put names with other characters in single quotes, or declare the convention flat." },
    Check { id: "V02a", clause: "3.0.2, 2.4.7.4", levels: Levels(None, Some(Level::Must)), run: Run::File(references),
        requirement: "Value references are unique.",
        tried: "Compares the value references of all variables.", fix: "Number the variables over all types; use Alias for a second name." },
    Check { id: "V02b", clause: "2.0.5, 2.2.7", levels: Levels(Some(Level::Must), None), run: Run::File(aliases),
        requirement: "Variables that share a value reference are true aliases: at most one can be set, constants alias only equal constants, and there is \
            one start value and one unit.",
        tried: "Compares variables of one base type that share a value reference.",
        fix: "Give each settable variable a separate reference, and one start value and one unit to a set of aliases." },
    Check { id: "V03", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.4", levels: Levels::MUST, run: Run::File(independent),
        requirement: "The independent variable is a continuous number without start and initial; FMI 3.0 requires exactly one, FMI 2.0 allows at most one.",
        tried: "Looks at the variables with causality independent.", fix: "Add one variable time, continuous, without start and initial." },
    Check { id: "V04a", clause: TABLE, levels: Levels::MUST, run: Run::File(pairs),
        requirement: "Causality and variability are a legal pair.",
        tried: "Looks causality and variability up in the table of the standard.",
        fix: "Take a pair of the table; parameters are fixed or tunable, inputs discrete or continuous." },
    Check { id: "V04b", clause: TABLE, levels: Levels::MUST, run: Run::File(initials),
        requirement: "The attribute initial has a value that causality and variability allow.",
        tried: "Looks initial up in the table of the standard.", fix: "Leave initial out where its default is right, and always at inputs of FMI 2.0." },
    Check { id: "V04c", clause: TABLE, levels: Levels::MUST, run: Run::File(starts),
        requirement: "A start value is present where it is required and absent where it is forbidden.",
        tried: "Compares the start value with initial, or with its default.",
        fix: "Add start to inputs, parameters and initial exact or approx; drop it where initial is calculated, the default of outputs." },
    Check { id: "V05", clause: TABLE, levels: Levels::MUST, run: Run::File(continuous),
        requirement: "Only floating-point variables are continuous; in FMI 2.0 all others give their variability, because continuous is its default.",
        tried: "Reads variability of all variables that are not floating-point.",
        fix: "Write variability=\"discrete\" (or fixed, tunable, constant) at Integer, Boolean, String and Enumeration." },
    Check { id: "V06a", clause: "2.0.5, 2.2.3; 3.0.2, 2.4.4", levels: Levels::SHOULD, run: Run::File(ranges),
        requirement: "min <= start <= max, the start value of an enumeration is one of its items, and nominal is not 0.",
        tried: "Compares min, start, max, items and nominal.",
        fix: "Correct the limits or the start value; leave nominal out if it is not known." },
    Check { id: "V08a", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.5", levels: Levels::MUST, run: Run::File(types),
        requirement: "declaredType names a type definition of the same base type; every enumeration has one.",
        tried: "Looks declaredType up in TypeDefinitions.", fix: "Define the type with the base type of the variable." },
    Check { id: "V08b", clause: "2.0.5, 2.2.3; 3.0.2, 2.4.4", levels: Levels::MUST, run: Run::File(definitions),
        requirement: "Type definitions have unique names; enumeration items have unique names and values.",
        tried: "Compares names of types, and names and values of enumeration items.", fix: "Give each its own name and value." },
    Check { id: "V09a", clause: "2.0.5, 2.2.3; 3.0.2, 2.4.4", levels: Levels::MUST, run: Run::File(unit_names),
        requirement: "Every unit is defined in UnitDefinitions, and a display unit comes with a unit; in FMI 3.0 it belongs to that unit.",
        tried: "Looks unit and displayUnit of variables and types up in UnitDefinitions.",
        fix: "Define the unit with its display units, or drop the attribute." },
    Check { id: "V09b", clause: "2.0.5, 2.2.2; 3.0.2, 2.4.3", levels: Levels::MUST, run: Run::File(unique_units),
        requirement: "Unit names are unique, and display unit names are unique within their unit.",
        tried: "Compares the names of units and of display units within a unit.", fix: "Define each once." },
    Check { id: "V09c", clause: "2.0.5, 2.2.2; 3.0.2, 2.4.3", levels: Levels::SHOULD, run: Run::File(bases),
        requirement: "The base unit of a common unit has the exponents and factor that the name implies.",
        tried: "Compares the base units of about 100 common names with their meaning.",
        fix: "Correct exponents, factor and offset: value in base units = factor * value + offset." },
    Check { id: "V09d", clause: "2.0.5, 2.2.2; 3.0.2, 2.4.3", levels: Levels::SHOULD, run: Run::File(displays),
        requirement: "A common display unit has the factor and offset that its name implies (display = factor * value + offset).",
        tried: "Compares the factors of common display units, and the offsets of temperatures, with their meaning.",
        fix: "Correct factor and offset: display value = factor * value + offset, the opposite direction to BaseUnit." },
    Check { id: "V10", clause: "3.0.2, 2.4.7.5", levels: Levels(None, Some(Level::Must)), run: Run::File(alias_units),
        requirement: "Only aliases of floating-point variables have a display unit, and it belongs to the unit of the variable.",
        tried: "Looks at the attribute displayUnit of aliases.", fix: "Define the display unit in the unit of the variable, or drop it." },
    Check { id: "V11", clause: "3.0.2, 2.4.7.4", levels: Levels(None, Some(Level::Must)), run: Run::File(flags),
        requirement: "Only continuous variables use intermediateUpdate, and only inputs use canHandleMultipleSetPerTimeInstant.",
        tried: "Looks at the two attributes of all variables.", fix: "Drop the attribute where it does not apply." },
    Check { id: "V08c", clause: "2.0.5, 2.2.3; 3.0.2, 2.4.4", levels: Levels::MUST, run: Run::File(names_of_types),
        requirement: "No type definition has the name of a variable.",
        tried: "Compares the names of types and variables.", fix: "Rename the type." },
    Check { id: "V15", clause: "3.0.2, 2.4.7.4", levels: Levels(None, Some(Level::Must)), run: Run::File(references_of_clocks),
        requirement: "The attribute clocks names clocks and belongs to discrete or tunable variables, clocks are discrete, and previous names another \
            discrete variable of the same type.",
        tried: "Follows both attributes of all variables.", fix: "Give the value references of clocks, and of the variable with the previous value." },
    Check { id: "V16", clause: "3.0.2, 2.4.4", levels: Levels(None, Some(Level::Must)), run: Run::File(intervals),
        requirement: "Periodic clocks, and no others, have an interval above 0 and no negative shift, and output clocks have no priority.",
        tried: "Reads the attributes of all clocks.",
        fix: "Give constant, fixed and tunable clocks an interval; drop what does not belong to the kind of clock." },
    Check { id: "V19", clause: "3.0.2, 2.4.4", levels: Levels(None, Some(Level::Hard)), run: Run::File(long_intervals),
        requirement: "A periodic clock ticks within the default experiment: its interval is in seconds.",
        tried: "Compares intervalDecimal with the default experiment.", fix: "Give intervals in seconds, not in milliseconds." },
    Check { id: "V17", clause: "3.0.2, 2.2.8.2", levels: Levels(None, Some(Level::Should)), run: Run::File(kinds),
        requirement: "A clock is an input, an output or a local variable, and triggered if it is not an input.",
        tried: "Reads causality and intervalVariability of all clocks.", fix: "Make a clock that the FMU ticks a triggered output." },
    Check { id: "V18", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.5", levels: Levels::MUST, run: Run::File(reinit),
        requirement: "Only continuous states have the attribute reinit.",
        tried: "Looks for the attribute at variables without a derivative.", fix: "Drop the attribute." },
    Check { id: "V13", clause: "3.0.2, 2.4.7.2", levels: Levels(None, Some(Level::Must)), run: Run::File(arrays),
        requirement: "A dimension is a positive number or refers to a structural parameter or constant of type UInt64, and an array has one start value or \
            as many as elements.",
        tried: "Follows dimensions to their structural parameters and counts start values.",
        fix: "Give one start value or one for each element, row by row." },
    Check { id: "V14", clause: "2.0.5, 2.2.7; 3.0.2, 2.4.7.5", levels: Levels::MUST, run: Run::File(start_value_types),
        requirement: "Start values have the type of the variable and lie within the range of that type.",
        tried: "Parses start values as values of the variable's type.", fix: "Write numbers with a point, in the range of the type." },
];

fn names(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut seen: HashMap<&str, usize> = HashMap::new();
        let mut findings = Vec::new();
        for v in &d.variables {
            for name in std::iter::once(v.name.as_str()).chain(v.aliases.iter().map(|a| a.name.as_str())) {
                if name.trim().is_empty() || name.contains(['\n', '\r', '\t']) {
                    findings.push(format!("line {}: the name {name:?} is empty or has control characters", v.line));
                }
                if let Some(first) = seen.insert(name, v.line) {
                    findings.push(format!("line {}: the name {name:?} is already used in line {first}", v.line));
                }
            }
        }
        findings
    })
}

fn structured(fmu: &FmuFile) -> Verdict {
    if fmu.description.as_ref().is_ok_and(|d| !d.structured_names) {
        return Verdict::NotApplicable("the naming convention is flat".into());
    }
    each(fmu, |_, v| {
        let mut all = std::iter::once(&v.name).chain(v.aliases.iter().map(|a| &a.name));
        all.find_map(|n| grammar(n).err().map(|why| format!("{n:?}: {why}")))
    })
}

fn references(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut seen: HashMap<u32, &ModelVariable> = HashMap::new();
        let mut findings = Vec::new();
        for v in &d.variables {
            if let Some(first) = seen.insert(v.value_reference, v) {
                let (reference, name) = (v.value_reference, &first.name);
                findings.push(format!(
                    "line {}: variable {}: has the value reference {reference} of {name}",
                    v.line, v.name
                ));
            }
        }
        findings
    })
}

fn aliases(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut sets: HashMap<(BaseType, u32), Vec<&ModelVariable>> = HashMap::new();
        for v in &d.variables {
            // Enumerations are got and set as integers.
            let base = if v.base == BaseType::Enumeration { BaseType::Int32 } else { v.base };
            sets.entry((base, v.value_reference)).or_default().push(v);
        }
        let mut findings = Vec::new();
        for set in sets.values().filter(|set| set.len() > 1) {
            let list = set.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", ");
            let mut wrong = |why: &str| findings.push(format!("line {}: the aliases {list}: {why}", set[0].line));
            let settable = |v: &&&ModelVariable| matches!(v.causality, Causality::Input | Causality::Parameter);
            if set.iter().filter(settable).count() > 1 {
                wrong("more than one of them can be set");
            }
            let constants = set.iter().filter(|v| v.variability == Variability::Constant).count();
            if constants != 0 && constants != set.len() {
                wrong("some are constants and some are not");
            }
            if constants == 0 && set.iter().filter(|v| v.start.is_some()).count() > 1 {
                wrong("more than one of them has a start value");
            }
            if constants > 0 && set.iter().any(|v| v.start != set[0].start) {
                wrong("they are constants with different values");
            }
            if set.iter().any(|v| v.unit != set[0].unit) {
                wrong("they have different units");
            }
        }
        findings.sort();
        findings
    })
}

fn independent(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let all: Vec<_> = d.variables.iter().filter(|v| v.causality == Causality::Independent).collect();
        let mut findings = Vec::new();
        if all.len() > 1 || (all.is_empty() && d.version == FmiVersion::V3) {
            findings.push(format!("there are {} independent variables", all.len()));
        }
        for v in all {
            if !v.base.is_float() || v.variability != Variability::Continuous {
                findings.push(format!("line {}: variable {}: is a {} {}", v.line, v.name, v.variability, v.base));
            }
            if v.start.is_some() || v.initial.is_some() {
                findings.push(format!("line {}: variable {}: has a start value or initial", v.line, v.name));
            }
        }
        findings
    })
}

/// Whether the file omits the variability. The default of FMI 2.0 is continuous for every type; except for Real this is illegal,
/// which V05 reports; the other checks read it as discrete.
fn by_default(fmu: &FmuFile, v: &ModelVariable) -> bool {
    let element = fmu.element_of(v);
    element.is_some_and(|e| e.get("variability").is_none())
}

fn variability(fmu: &FmuFile, v: &ModelVariable) -> Variability {
    if fmu.version == FmiVersion::V2 && !v.base.is_float() && by_default(fmu, v) {
        Variability::Discrete
    } else {
        v.variability
    }
}

fn pairs(fmu: &FmuFile) -> Verdict {
    use Causality as C;
    use Variability as V;
    each(fmu, |_, v| {
        let variability = variability(fmu, v);
        let legal = match v.causality {
            C::StructuralParameter | C::Parameter | C::CalculatedParameter => {
                matches!(variability, V::Fixed | V::Tunable)
            }
            C::Input => matches!(variability, V::Discrete | V::Continuous),
            C::Output => matches!(variability, V::Constant | V::Discrete | V::Continuous),
            C::Local => true,
            C::Independent => variability == V::Continuous,
        };
        (!legal).then(|| format!("causality {} with variability {variability}", v.causality))
    })
}

/// The values of `initial` that a pair allows; `None` where the attribute must be absent.
fn allowed(version: FmiVersion, causality: Causality, variability: Variability) -> Option<&'static [Initial]> {
    use Initial::{Approx, Calculated, Exact};
    match (causality, variability) {
        (Causality::Independent, _) => None,
        (Causality::Input, _) if version == FmiVersion::V2 => None,
        (Causality::Input | Causality::Parameter | Causality::StructuralParameter, _) | (_, Variability::Constant) => {
            Some(&[Exact])
        }
        (Causality::CalculatedParameter, _) | (_, Variability::Fixed | Variability::Tunable) => {
            Some(&[Calculated, Approx])
        }
        _ => Some(&[Calculated, Exact, Approx]),
    }
}

fn initials(fmu: &FmuFile) -> Verdict {
    each(fmu, |d, v| {
        let initial = v.initial?;
        match allowed(d.version, v.causality, variability(fmu, v)) {
            None => Some(format!("initial={initial} with causality {}", v.causality)),
            Some(set) if set.contains(&initial) => None,
            Some(_) => {
                Some(format!("initial={initial} with causality {} and variability {}", v.causality, v.variability))
            }
        }
    })
}

fn starts(fmu: &FmuFile) -> Verdict {
    each(fmu, |d, v| {
        if v.base == BaseType::Clock || v.causality == Causality::Independent {
            return None;
        }
        let input = v.causality == Causality::Input && d.version == FmiVersion::V2;
        let initial = if input { Some(Initial::Exact) } else { v.initial_or_default() };
        match (initial, v.start.is_some()) {
            (Some(Initial::Exact | Initial::Approx), false) => Some(format!(
                "there is no start value, required with causality {} and initial {}",
                v.causality,
                initial.map_or("none", Initial::as_str)
            )),
            (Some(Initial::Calculated), true) => {
                Some("there is a start value, forbidden with initial calculated".into())
            }
            _ => None,
        }
    })
}

fn continuous(fmu: &FmuFile) -> Verdict {
    each(fmu, |_, v| {
        let default = fmu.version == FmiVersion::V2 && by_default(fmu, v);
        let bad = !v.base.is_float() && (default || variability(fmu, v) == Variability::Continuous);
        let how = if default { " by default: there is no attribute variability" } else { "" };
        bad.then(|| format!("is a continuous {}{how}", v.base))
    })
}

fn ranges(fmu: &FmuFile) -> Verdict {
    each(fmu, |d, v| {
        if v.min.zip(v.max).is_some_and(|(min, max)| min > max) {
            return Some(format!("min = {} is greater than max = {}", v.min?, v.max?));
        }
        if v.nominal == Some(0.0) {
            return Some("nominal is 0".into());
        }
        if matches!(v.base, BaseType::String | BaseType::Binary | BaseType::Boolean | BaseType::Clock) {
            return None;
        }
        let items = v.declared_type.as_deref().and_then(|name| d.type_definition(name)).map(|t| &t.items);
        if let Some(items) = items.filter(|_| v.base == BaseType::Enumeration) {
            let is_item = |word: &&str| items.iter().any(|item| item.value.to_string() == *word);
            if let Some(word) = v.start.as_deref()?.split_whitespace().find(|word| !is_item(word)) {
                return Some(format!("start = {word} is not among the items of its type"));
            }
        }
        let numbers = v.start.as_deref()?.split_whitespace().filter_map(parse_number);
        let outside = |x: &f64| v.min.is_some_and(|min| *x < min) || v.max.is_some_and(|max| *x > max);
        numbers.into_iter().find(outside).map(|x| format!("start = {x} is outside min and max"))
    })
}

fn flags(fmu: &FmuFile) -> Verdict {
    with_description(fmu, |d| {
        let mut findings = Vec::new();
        for v in &d.variables {
            let Some(element) = fmu.element_of(v) else { continue };
            let on = |a: &str| element.get(a).is_some_and(|v| matches!(v.trim(), "true" | "1"));
            if on("intermediateUpdate") && (v.variability != Variability::Continuous || v.base == BaseType::Clock) {
                findings.push(format!(
                    "line {}: variable {}: has intermediateUpdate but is {}",
                    v.line, v.name, v.variability
                ));
            }
            if on("canHandleMultipleSetPerTimeInstant") && v.causality != Causality::Input {
                findings.push(format!(
                    "line {}: variable {}: has canHandleMultipleSetPerTimeInstant but is not an input",
                    v.line, v.name
                ));
            }
        }
        findings
    })
}

fn arrays(fmu: &FmuFile) -> Verdict {
    each(fmu, |d, v| {
        if v.causality == Causality::StructuralParameter && !v.dimensions.is_empty() {
            return Some("is a structural parameter with a dimension".into());
        }
        if v.dimensions.is_empty() {
            let many = v.start.as_deref().is_some_and(|s| s.split_whitespace().count() > 1);
            let text = matches!(v.base, BaseType::String | BaseType::Binary);
            return (many && !text).then(|| "is a scalar with several start values".into());
        }
        let mut elements = 1_u64;
        for dimension in &v.dimensions {
            let extent = match dimension {
                Dimension::Fixed(0) => return Some("has a dimension of 0".into()),
                Dimension::Fixed(n) => *n,
                Dimension::Variable(reference) => {
                    let Some(size) = d.variables.iter().find(|s| s.value_reference == *reference) else {
                        return Some(format!("its dimension refers to {reference}, which does not exist"));
                    };
                    let fits =
                        size.causality == Causality::StructuralParameter || size.variability == Variability::Constant;
                    if !fits || size.base != BaseType::UInt64 {
                        return Some(format!(
                            "its dimension {} is not a structural parameter or constant of type UInt64",
                            size.name
                        ));
                    }
                    size.start.as_deref().and_then(|s| s.trim().parse().ok()).unwrap_or(1)
                }
            };
            elements = elements.saturating_mul(extent);
        }
        let text = matches!(v.base, BaseType::String | BaseType::Binary);
        let given = if text { v.start_texts.len() } else { v.start.as_deref()?.split_whitespace().count() } as u64;
        (given > 1 && given != elements).then(|| format!("has {given} start values for {elements} elements"))
    })
}

fn start_value_types(fmu: &FmuFile) -> Verdict {
    each(fmu, |_, v| {
        if let (BaseType::Binary, Some(most)) = (v.base, v.max_size) {
            let starts = v.start_texts.iter().map(String::as_str).chain(v.start.as_deref());
            let longest = starts.map(|hex| hex.trim().len() as u64 / 2).max().unwrap_or(0);
            if longest > most {
                return Some(format!("has a start value of {longest} bytes, and maxSize is {most}"));
            }
        }
        let start = v.start.as_deref()?;
        let (low, high): (i128, i128) = match v.base {
            BaseType::Int8 => (i8::MIN.into(), i8::MAX.into()),
            BaseType::UInt8 => (0, u8::MAX.into()),
            BaseType::Int16 => (i16::MIN.into(), i16::MAX.into()),
            BaseType::UInt16 => (0, u16::MAX.into()),
            BaseType::Int32 => (i32::MIN.into(), i32::MAX.into()),
            BaseType::UInt32 => (0, u32::MAX.into()),
            BaseType::UInt64 => (0, u64::MAX.into()),
            _ => (i64::MIN.into(), i64::MAX.into()),
        };
        let good = |word: &str| match v.base {
            BaseType::Float32 | BaseType::Float64 => parse_number(word).is_some(),
            BaseType::Boolean => ["true", "false", "0", "1"].contains(&word),
            BaseType::String | BaseType::Clock => true,
            BaseType::Binary => word.len().is_multiple_of(2) && word.bytes().all(|b| b.is_ascii_hexdigit()),
            _ => word.parse::<i128>().is_ok_and(|x| (low..=high).contains(&x)),
        };
        if v.base == BaseType::String {
            return None;
        }
        start
            .split_whitespace()
            .find(|w| !good(w))
            .map(|w| format!("start={w:?} is not a value of the type {}", v.base))
    })
}
