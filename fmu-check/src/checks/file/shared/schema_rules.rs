//! Content that the standards allow in modelDescription.xml, terminalsAndIcons.xml and buildDescription.xml: elements, attributes,
//! and the order of children.
//!
//! One line per element: its path from the root, its attributes with their forms (`!` required), its children in order.
//! Forms: `s` text, `b` boolean, `i32` or `u64` an integer of that size, `n` integer from 0 on, `N` number of the element's own type,
//! `d` number, `t` date and time, `x` hexadecimal digits, `c` color, `=kind` one of the [`words`]; `*` before a form: a list of them.
//! A lone `*` allows any other attribute.
//! Children: `?` at most one, `!` exactly one, `+` at least one, nothing: any number; `a|b` are alternatives. `~` before the children:
//! at least one, in any order. `*` alone: any content; `*?`: one element at most, no text.
//! Facts of FMI 2.0.5, 2.2 and FMI 3.0.2, 2.4 in our own words.

/// An element of the standard.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rule {
    pub(crate) element: &'static str,
    pub(crate) attributes: &'static str,
    pub(crate) children: &'static str,
}

const fn rule(element: &'static str, attributes: &'static str, children: &'static str) -> Rule {
    Rule { element, attributes, children }
}

const REAL: &str = "quantity:s unit:s displayUnit:s relativeQuantity:b unbounded:b min:d max:d nominal:d";

#[rustfmt::skip]
pub(crate) const V2: &[Rule] = &[
    rule("fmiModelDescription",
        "fmiVersion:s! modelName:s! guid:s! description:s author:s version:s copyright:s license:s generationTool:s generationDateAndTime:t \
         variableNamingConvention:=naming numberOfEventIndicators:u32",
        "ModelExchange|CoSimulation+ UnitDefinitions? TypeDefinitions? LogCategories? DefaultExperiment? VendorAnnotations? ModelVariables! ModelStructure!"),
    rule("ModelExchange",
        "modelIdentifier:s! needsExecutionTool:b completedIntegratorStepNotNeeded:b canBeInstantiatedOnlyOncePerProcess:b \
         canNotUseMemoryManagementFunctions:b canGetAndSetFMUstate:b canSerializeFMUstate:b providesDirectionalDerivative:b",
        "SourceFiles?"),
    rule("CoSimulation",
        "modelIdentifier:s! needsExecutionTool:b canHandleVariableCommunicationStepSize:b canInterpolateInputs:b maxOutputDerivativeOrder:u32 \
         canRunAsynchronuously:b canBeInstantiatedOnlyOncePerProcess:b canNotUseMemoryManagementFunctions:b canGetAndSetFMUstate:b \
         canSerializeFMUstate:b providesDirectionalDerivative:b",
        "SourceFiles?"),
    rule("SourceFiles", "", "File+"),
    rule("File", "name:s!", ""),
    rule("UnitDefinitions", "", "Unit+"),
    rule("Unit", "name:s!", "BaseUnit? DisplayUnit"),
    rule("BaseUnit", "kg:i32 m:i32 s:i32 A:i32 K:i32 mol:i32 cd:i32 rad:i32 factor:d offset:d", ""),
    rule("DisplayUnit", "name:s! factor:d offset:d", ""),
    rule("TypeDefinitions", "", "SimpleType+"),
    rule("SimpleType", "name:s! description:s", "Real|Integer|Boolean|String|Enumeration!"),
    rule("SimpleType/Real", REAL, ""),
    rule("SimpleType/Integer", "quantity:s min:i32 max:i32", ""),
    // The schema gives these two no type.
    rule("SimpleType/Boolean", "*", "*"),
    rule("SimpleType/String", "*", "*"),
    rule("SimpleType/Enumeration", "quantity:s", "Item+"),
    rule("Item", "name:s! value:i32! description:s", ""),
    rule("LogCategories", "", "Category+"),
    rule("Category", "name:s! description:s", ""),
    rule("DefaultExperiment", "startTime:d stopTime:d tolerance:d stepSize:d", ""),
    rule("VendorAnnotations", "", "Tool+"),
    rule("Tool", "name:s!", "*?"),
    rule("ModelVariables", "", "ScalarVariable+"),
    rule("ScalarVariable",
        "name:s! valueReference:u32! description:s causality:=causality2 variability:=variability initial:=initial \
         canHandleMultipleSetPerTimeInstant:b",
        "Real|Integer|Boolean|String|Enumeration! Annotations?"),
    rule("Annotations", "", "Tool+"),
    rule("ScalarVariable/Real",
        "declaredType:s quantity:s unit:s displayUnit:s relativeQuantity:b unbounded:b min:d max:d nominal:d start:d derivative:u32 reinit:b",
        ""),
    rule("ScalarVariable/Integer", "declaredType:s quantity:s min:i32 max:i32 start:i32", ""),
    rule("ScalarVariable/Boolean", "declaredType:s start:b", ""),
    rule("ScalarVariable/String", "declaredType:s start:s", ""),
    rule("ScalarVariable/Enumeration", "declaredType:s! quantity:s min:i32 max:i32 start:i32", ""),
    rule("ModelStructure", "", "Outputs? Derivatives? InitialUnknowns?"),
    rule("Outputs", "", "Unknown+"),
    rule("Derivatives", "", "Unknown+"),
    rule("InitialUnknowns", "", "Unknown+"),
    rule("Unknown", "index:u32! dependencies:*u32 dependenciesKind:*=dependency", ""),
];

const SUPPORT: &str = "\
    modelIdentifier:s! needsExecutionTool:b canBeInstantiatedOnlyOncePerProcess:b canGetAndSetFMUState:b canSerializeFMUState:b \
    providesDirectionalDerivatives:b providesAdjointDerivatives:b providesPerElementDependencies:b";
const VARIABLE: &str = "\
    name:s! valueReference:u32! description:s causality:=causality3 variability:=variability canHandleMultipleSetPerTimeInstant:b clocks:*u32 \
    intermediateUpdate:b previous:u32";
const CLOCK: &str = "\
    canBeDeactivated:b priority:u32 intervalVariability:=interval! intervalDecimal:d shiftDecimal:d supportsFraction:b resolution:u64 \
    intervalCounter:u64 shiftCounter:u64";

#[rustfmt::skip]
pub(crate) const V3: &[Rule] = &[
    rule("fmiModelDescription",
        "fmiVersion:s! modelName:s! instantiationToken:s! description:s author:s version:s copyright:s license:s generationTool:s \
         generationDateAndTime:t variableNamingConvention:=naming",
        "ModelExchange? CoSimulation? ScheduledExecution? UnitDefinitions? TypeDefinitions? LogCategories? DefaultExperiment? ModelVariables! \
         ModelStructure! Annotations?"),
    rule("ModelExchange", "@support needsCompletedIntegratorStep:b providesEvaluateDiscreteStates:b *", "Annotations?"),
    rule("CoSimulation",
        "@support canHandleVariableCommunicationStepSize:b fixedInternalStepSize:d maxOutputDerivativeOrder:u32 \
         recommendedIntermediateInputSmoothness:i32 providesIntermediateUpdate:b mightReturnEarlyFromDoStep:b canReturnEarlyAfterIntermediateUpdate:b \
         hasEventMode:b providesEvaluateDiscreteStates:b *",
        "Annotations?"),
    rule("ScheduledExecution", "@support *", "Annotations?"),
    rule("UnitDefinitions", "", "Unit+"),
    rule("Unit", "name:s!", "BaseUnit? DisplayUnit Annotations?"),
    rule("BaseUnit", "kg:i32 m:i32 s:i32 A:i32 K:i32 mol:i32 cd:i32 rad:i32 factor:d offset:d", ""),
    rule("DisplayUnit", "name:s! factor:d offset:d inverse:b", "Annotations?"),
    rule("TypeDefinitions", "",
        "~Float32Type Float64Type Int8Type UInt8Type Int16Type UInt16Type Int32Type UInt32Type Int64Type UInt64Type \
         BooleanType StringType BinaryType EnumerationType ClockType"),
    rule("Float32Type", "name:s! description:s @real", "Annotations?"),
    rule("Float64Type", "name:s! description:s @real", "Annotations?"),
    rule("@IntegerType", "name:s! description:s quantity:s min:N max:N", "Annotations?"),
    rule("BooleanType", "name:s! description:s", "Annotations?"),
    rule("StringType", "name:s! description:s", "Annotations?"),
    rule("BinaryType", "name:s! description:s mimeType:s maxSize:n", "Annotations?"),
    rule("EnumerationType", "name:s! description:s quantity:s min:i64 max:i64", "Annotations? Item+"),
    rule("Item", "name:s! value:i64! description:s", "Annotations?"),
    rule("ClockType", "name:s! description:s @clock", "Annotations?"),
    rule("LogCategories", "", "Category+"),
    rule("Category", "name:s! description:s", "Annotations?"),
    rule("DefaultExperiment", "startTime:d stopTime:d tolerance:d stepSize:d", "Annotations?"),
    rule("Annotations", "", "Annotation+"),
    rule("Annotation", "type:s!", "*"),
    rule("ModelVariables", "", "~Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Enumeration Clock"),
    rule("Float32", "@variable declaredType:s initial:=initial @real start:*d derivative:u32 reinit:b", "Annotations? Dimension Alias"),
    rule("Float64", "@variable declaredType:s initial:=initial @real start:*d derivative:u32 reinit:b", "Annotations? Dimension Alias"),
    rule("@Integer", "@variable declaredType:s initial:=initial quantity:s min:N max:N start:*N", "Annotations? Dimension Alias"),
    rule("Boolean", "@variable declaredType:s initial:=initial start:*b", "Annotations? Dimension Alias"),
    rule("String", "@variable declaredType:s initial:=initial", "Annotations? Dimension Start Alias"),
    rule("Binary", "@variable declaredType:s initial:=initial mimeType:s maxSize:n", "Annotations? Dimension Start Alias"),
    rule("Enumeration", "@variable declaredType:s! initial:=initial quantity:s min:i64 max:i64 start:*i64", "Annotations? Dimension Alias"),
    rule("Clock",
        "name:s! valueReference:u32! description:s causality:=causality3 variability:=variability canHandleMultipleSetPerTimeInstant:b clocks:*u32 \
         declaredType:s @clock",
        "Annotations? Alias"),
    rule("Dimension", "start:u64 valueReference:u32", ""),
    rule("String/Start", "value:s!", ""),
    rule("Binary/Start", "value:x!", ""),
    rule("Alias", "name:s! description:s displayUnit:s", ""),
    rule("ModelStructure", "", "Output ContinuousStateDerivative ClockedState InitialUnknown EventIndicator"),
    rule("Output", "valueReference:u32! dependencies:*u32 dependenciesKind:*=dependency", "Annotations?"),
    rule("ContinuousStateDerivative", "valueReference:u32! dependencies:*u32 dependenciesKind:*=dependency", "Annotations?"),
    rule("ClockedState", "valueReference:u32! dependencies:*u32 dependenciesKind:*=dependency", "Annotations?"),
    rule("InitialUnknown", "valueReference:u32! dependencies:*u32 dependenciesKind:*=dependency", "Annotations?"),
    rule("EventIndicator", "valueReference:u32! dependencies:*u32 dependenciesKind:*=dependency", "Annotations?"),
];

/// terminalsAndIcons.xml, FMI 3.0.2, 2.4.9.
#[rustfmt::skip]
pub(crate) const TERMINALS: &[Rule] = &[
    rule("fmiTerminalsAndIcons", "fmiVersion:s!", "GraphicalRepresentation? Terminals? Annotations?"),
    rule("GraphicalRepresentation", "", "CoordinateSystem? Icon? Annotations?"),
    rule("CoordinateSystem", "x1:d! y1:d! x2:d! y2:d! suggestedScalingFactorTo_mm:d!", ""),
    rule("Icon", "x1:d! y1:d! x2:d! y2:d!", ""),
    rule("Terminals", "", "Terminal+"),
    rule("Terminal", "name:s! matchingRule:s! terminalKind:s description:s",
        "TerminalMemberVariable TerminalStreamMemberVariable Terminal TerminalGraphicalRepresentation? Annotations?"),
    rule("TerminalMemberVariable", "variableName:s! memberName:s variableKind:s!", "Annotations?"),
    rule("TerminalStreamMemberVariable", "inStreamMemberName:s! outStreamMemberName:s! inStreamVariableName:s! outStreamVariableName:s!", "Annotations?"),
    rule("TerminalGraphicalRepresentation", "defaultConnectionColor:c defaultConnectionStrokeSize:d x1:d! y1:d! x2:d! y2:d! iconBaseName:s!", "Annotations?"),
    rule("Annotations", "", "Annotation+"),
    rule("Annotation", "type:s!", "*"),
];

/// sources/buildDescription.xml, FMI 3.0.2, 2.5.1.4.1.
#[rustfmt::skip]
pub(crate) const BUILD: &[Rule] = &[
    rule("fmiBuildDescription", "fmiVersion:s!", "BuildConfiguration+ Annotations?"),
    rule("BuildConfiguration", "modelIdentifier:s! platform:s description:s", "SourceFileSet Library Annotations?"),
    rule("SourceFileSet", "name:s language:s compiler:s compilerOptions:s", "SourceFile+ PreprocessorDefinition IncludeDirectory Annotations?"),
    rule("SourceFile", "name:s!", "Annotations?"),
    rule("PreprocessorDefinition", "name:s! optional:b value:s description:s", "Option Annotations?"),
    rule("Option", "value:s description:s", ""),
    rule("IncludeDirectory", "name:s!", "Annotations?"),
    rule("Library", "name:s! version:s external:b description:s", "Annotations?"),
    rule("Annotations", "", "Annotation+"),
    rule("Annotation", "type:s!", "*"),
];

/// The attributes that an `@` word stands for.
pub(crate) fn expand(word: &str) -> &'static str {
    match word {
        "@support" => SUPPORT,
        "@variable" => VARIABLE,
        "@real" => REAL,
        "@clock" => CLOCK,
        _ => "",
    }
}

/// The words of a kind.
pub(crate) fn words(kind: &str) -> &'static [&'static str] {
    match kind {
        "naming" => &["flat", "structured"],
        "causality2" => &["parameter", "calculatedParameter", "input", "output", "local", "independent"],
        "causality3" => {
            &["parameter", "calculatedParameter", "input", "output", "local", "independent", "structuralParameter"]
        }
        "variability" => &["constant", "fixed", "tunable", "discrete", "continuous"],
        "initial" => &["exact", "approx", "calculated"],
        "interval" => &["constant", "fixed", "tunable", "changing", "countdown", "triggered"],
        "dependency" => &["dependent", "constant", "fixed", "tunable", "discrete"],
        _ => &[],
    }
}
