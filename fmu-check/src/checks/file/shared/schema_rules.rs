//! Content that the standards allow in modelDescription.xml and terminalsAndIcons.xml: elements, attributes, and the order of
//! children.
//!
//! One line per element: its path from the root, its attributes with their forms (`!` required), its children in order.
//! Forms: `s` text, `b` boolean, `i` integer, `u` unsigned integer, `d` number, `t` date and time, `l` list of unsigned
//! integers, `w` words, `c` color, `*` anything.
//! A lone `*` allows any other attribute. `~` before the children: their order is free. Facts of FMI 2.0.5, 2.2 and FMI 3.0.2, 2.4 in our own words.

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
         variableNamingConvention:s numberOfEventIndicators:u",
        "ModelExchange|CoSimulation UnitDefinitions? TypeDefinitions? LogCategories? DefaultExperiment? VendorAnnotations? ModelVariables! ModelStructure!"),
    rule("ModelExchange",
        "modelIdentifier:s! needsExecutionTool:b completedIntegratorStepNotNeeded:b canBeInstantiatedOnlyOncePerProcess:b \
         canNotUseMemoryManagementFunctions:b canGetAndSetFMUstate:b canSerializeFMUstate:b providesDirectionalDerivative:b",
        "SourceFiles?"),
    rule("CoSimulation",
        "modelIdentifier:s! needsExecutionTool:b canHandleVariableCommunicationStepSize:b canInterpolateInputs:b maxOutputDerivativeOrder:u \
         canRunAsynchronuously:b canBeInstantiatedOnlyOncePerProcess:b canNotUseMemoryManagementFunctions:b canGetAndSetFMUstate:b \
         canSerializeFMUstate:b providesDirectionalDerivative:b",
        "SourceFiles?"),
    rule("SourceFiles", "", "File!"),
    rule("File", "name:s!", ""),
    rule("UnitDefinitions", "", "Unit!"),
    rule("Unit", "name:s!", "BaseUnit? DisplayUnit"),
    rule("BaseUnit", "kg:i m:i s:i A:i K:i mol:i cd:i rad:i factor:d offset:d", ""),
    rule("DisplayUnit", "name:s! factor:d offset:d", ""),
    rule("TypeDefinitions", "", "SimpleType!"),
    rule("SimpleType", "name:s! description:s", "Real|Integer|Boolean|String|Enumeration"),
    rule("SimpleType/Real", REAL, ""),
    rule("SimpleType/Integer", "quantity:s min:i max:i", ""),
    rule("SimpleType/Boolean", "", ""),
    rule("SimpleType/String", "", ""),
    rule("SimpleType/Enumeration", "quantity:s", "Item!"),
    rule("Item", "name:s! value:i! description:s", ""),
    rule("LogCategories", "", "Category!"),
    rule("Category", "name:s! description:s", ""),
    rule("DefaultExperiment", "startTime:d stopTime:d tolerance:d stepSize:d", ""),
    rule("VendorAnnotations", "", "Tool!"),
    rule("Tool", "name:s!", "*"),
    rule("ModelVariables", "", "ScalarVariable!"),
    rule("ScalarVariable",
        "name:s! valueReference:u! description:s causality:s variability:s initial:s canHandleMultipleSetPerTimeInstant:b",
        "Real|Integer|Boolean|String|Enumeration Annotations?"),
    rule("Annotations", "", "Tool!"),
    rule("ScalarVariable/Real",
        "declaredType:s quantity:s unit:s displayUnit:s relativeQuantity:b unbounded:b min:d max:d nominal:d start:d derivative:u reinit:b",
        ""),
    rule("ScalarVariable/Integer", "declaredType:s quantity:s min:i max:i start:i", ""),
    rule("ScalarVariable/Boolean", "declaredType:s start:b", ""),
    rule("ScalarVariable/String", "declaredType:s start:s", ""),
    rule("ScalarVariable/Enumeration", "declaredType:s! quantity:s min:i max:i start:i", ""),
    rule("ModelStructure", "", "Outputs? Derivatives? InitialUnknowns?"),
    rule("Outputs", "", "Unknown!"),
    rule("Derivatives", "", "Unknown!"),
    rule("InitialUnknowns", "", "Unknown!"),
    rule("Unknown", "index:u! dependencies:l dependenciesKind:w", ""),
];

const SUPPORT: &str = "\
    modelIdentifier:s! needsExecutionTool:b canBeInstantiatedOnlyOncePerProcess:b canGetAndSetFMUState:b canSerializeFMUState:b \
    providesDirectionalDerivatives:b providesAdjointDerivatives:b providesPerElementDependencies:b";
const VARIABLE: &str = "\
    name:s! valueReference:u! description:s causality:s variability:s canHandleMultipleSetPerTimeInstant:b clocks:l intermediateUpdate:b previous:u";
const CLOCK: &str = "\
    canBeDeactivated:b priority:u intervalVariability:s! intervalDecimal:d shiftDecimal:d supportsFraction:b resolution:u intervalCounter:u \
    shiftCounter:u";

#[rustfmt::skip]
pub(crate) const V3: &[Rule] = &[
    rule("fmiModelDescription",
        "fmiVersion:s! modelName:s! instantiationToken:s! description:s author:s version:s copyright:s license:s generationTool:s \
         generationDateAndTime:t variableNamingConvention:s",
        "ModelExchange? CoSimulation? ScheduledExecution? UnitDefinitions? TypeDefinitions? LogCategories? DefaultExperiment? ModelVariables! \
         ModelStructure! Annotations?"),
    rule("ModelExchange", "@support needsCompletedIntegratorStep:b providesEvaluateDiscreteStates:b *", "Annotations?"),
    rule("CoSimulation",
        "@support canHandleVariableCommunicationStepSize:b fixedInternalStepSize:d maxOutputDerivativeOrder:u \
         recommendedIntermediateInputSmoothness:i providesIntermediateUpdate:b mightReturnEarlyFromDoStep:b canReturnEarlyAfterIntermediateUpdate:b \
         hasEventMode:b providesEvaluateDiscreteStates:b *",
        "Annotations?"),
    rule("ScheduledExecution", "@support *", "Annotations?"),
    rule("UnitDefinitions", "", "Unit!"),
    rule("Unit", "name:s!", "BaseUnit? DisplayUnit Annotations?"),
    rule("BaseUnit", "kg:i m:i s:i A:i K:i mol:i cd:i rad:i factor:d offset:d", ""),
    rule("DisplayUnit", "name:s! factor:d offset:d inverse:b", "Annotations?"),
    rule("TypeDefinitions", "",
        "~Float32Type Float64Type Int8Type UInt8Type Int16Type UInt16Type Int32Type UInt32Type Int64Type UInt64Type \
         BooleanType StringType BinaryType EnumerationType ClockType"),
    rule("Float32Type", "name:s! description:s @real", "Annotations?"),
    rule("Float64Type", "name:s! description:s @real", "Annotations?"),
    rule("@IntegerType", "name:s! description:s quantity:s min:i max:i", "Annotations?"),
    rule("BooleanType", "name:s! description:s", "Annotations?"),
    rule("StringType", "name:s! description:s", "Annotations?"),
    rule("BinaryType", "name:s! description:s mimeType:s maxSize:u", "Annotations?"),
    rule("EnumerationType", "name:s! description:s quantity:s min:i max:i", "Annotations? Item!"),
    rule("Item", "name:s! value:i! description:s", "Annotations?"),
    rule("ClockType", "name:s! description:s @clock", "Annotations?"),
    rule("LogCategories", "", "Category!"),
    rule("Category", "name:s! description:s", "Annotations?"),
    rule("DefaultExperiment", "startTime:d stopTime:d tolerance:d stepSize:d", "Annotations?"),
    rule("Annotations", "", "Annotation!"),
    rule("Annotation", "type:s!", "*"),
    rule("ModelVariables", "", "~Float32 Float64 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String Binary Enumeration Clock"),
    rule("Float32", "@variable declaredType:s initial:s @real start:* derivative:u reinit:b", "Annotations? Dimension Alias"),
    rule("Float64", "@variable declaredType:s initial:s @real start:* derivative:u reinit:b", "Annotations? Dimension Alias"),
    rule("@Integer", "@variable declaredType:s initial:s quantity:s min:i max:i start:*", "Annotations? Dimension Alias"),
    rule("Boolean", "@variable declaredType:s initial:s start:*", "Annotations? Dimension Alias"),
    rule("String", "@variable declaredType:s initial:s", "Annotations? Dimension Start Alias"),
    rule("Binary", "@variable declaredType:s initial:s mimeType:s maxSize:u", "Annotations? Dimension Start Alias"),
    rule("Enumeration", "@variable declaredType:s! initial:s quantity:s min:i max:i start:*", "Annotations? Dimension Alias"),
    rule("Clock",
        "name:s! valueReference:u! description:s causality:s variability:s canHandleMultipleSetPerTimeInstant:b clocks:l declaredType:s @clock",
        "Annotations? Alias"),
    rule("Dimension", "start:u valueReference:u", ""),
    rule("Start", "value:*!", ""),
    rule("Alias", "name:s! description:s displayUnit:s", "Annotations?"),
    rule("ModelStructure", "", "Output ContinuousStateDerivative ClockedState InitialUnknown EventIndicator Annotations?"),
    rule("Output", "valueReference:u! dependencies:l dependenciesKind:w", "Annotations?"),
    rule("ContinuousStateDerivative", "valueReference:u! dependencies:l dependenciesKind:w", "Annotations?"),
    rule("ClockedState", "valueReference:u! dependencies:l dependenciesKind:w", "Annotations?"),
    rule("InitialUnknown", "valueReference:u! dependencies:l dependenciesKind:w", "Annotations?"),
    rule("EventIndicator", "valueReference:u! dependencies:l dependenciesKind:w", "Annotations?"),
];

/// terminalsAndIcons.xml, FMI 3.0.2, 2.4.9.
#[rustfmt::skip]
pub(crate) const TERMINALS: &[Rule] = &[
    rule("fmiTerminalsAndIcons", "fmiVersion:s!", "GraphicalRepresentation? Terminals? Annotations?"),
    rule("GraphicalRepresentation", "", "CoordinateSystem? Icon? Annotations?"),
    rule("CoordinateSystem", "x1:d! y1:d! x2:d! y2:d! suggestedScalingFactorTo_mm:d!", ""),
    rule("Icon", "x1:d! y1:d! x2:d! y2:d!", ""),
    rule("Terminals", "", "Terminal!"),
    rule("Terminal", "name:s! matchingRule:s! terminalKind:s description:s",
        "TerminalMemberVariable TerminalStreamMemberVariable Terminal TerminalGraphicalRepresentation? Annotations?"),
    rule("TerminalMemberVariable", "variableName:s! memberName:s variableKind:s!", "Annotations?"),
    rule("TerminalStreamMemberVariable", "inStreamMemberName:s! outStreamMemberName:s! inStreamVariableName:s! outStreamVariableName:s!", "Annotations?"),
    rule("TerminalGraphicalRepresentation", "defaultConnectionColor:c defaultConnectionStrokeSize:d x1:d! y1:d! x2:d! y2:d! iconBaseName:s!", "Annotations?"),
    rule("Annotations", "", "Annotation!"),
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
