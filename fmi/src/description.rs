//! modelDescription.xml in the two versions of the standard.

use std::collections::BTreeMap;
use std::io;

use hapt_model::Parameter;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesEnd, BytesStart, Event};

use crate::log::CATEGORIES;
use crate::model::Model;
use crate::units::{Definition, definitions, unit_of};
use crate::variable::{PUCK, Role, Value, Variable};
use crate::{Kind, Version};

/// The library's name without the prefix and suffix of a platform.
pub const IDENTIFIER: &str = "hapt_fmi";

/// The attributes of an element.
type Attributes<'a> = Vec<(&'a str, String)>;

/// A description under construction.
struct Xml(Writer<Vec<u8>>);

impl Xml {
    fn open(&mut self, name: &str, attributes: &Attributes<'_>) -> io::Result<()> {
        self.0.write_event(Event::Start(element(name, attributes)))
    }

    fn close(&mut self, name: &str) -> io::Result<()> {
        self.0.write_event(Event::End(BytesEnd::new(name)))
    }

    fn empty(&mut self, name: &str, attributes: &Attributes<'_>) -> io::Result<()> {
        self.0.write_event(Event::Empty(element(name, attributes)))
    }
}

fn element<'a>(name: &'a str, attributes: &Attributes<'_>) -> BytesStart<'a> {
    let mut element = BytesStart::new(name);
    for (name, value) in attributes {
        element.push_attribute((*name, value.as_str()));
    }
    element
}

/// The description of an FMU called `name`. `written` are the world's keys as in its file: their units are the display units of the
/// parameters.
pub fn description(model: &Model, name: &str, written: &[Parameter], version: Version) -> Vec<u8> {
    let mut xml = Xml(Writer::new_with_indent(Vec::new(), b' ', 2));
    // Writing to a vector does not fail.
    let _ = write(&mut xml, model, name, written, version);
    let mut bytes = xml.0.into_inner();
    bytes.push(b'\n');
    bytes
}

fn write(xml: &mut Xml, model: &Model, name: &str, written: &[Parameter], version: Version) -> io::Result<()> {
    xml.0.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    let name: String = name.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    let what = match model.kind {
        Kind::Loop => "The sampled loop of a haptic world: from the puck's motion to the torque on it.",
        Kind::Whole => "A haptic world's sampled loop on its exact device: from the hand's torque to the motion.",
    };
    let tool = concat!("hapt ", env!("CARGO_PKG_VERSION"));
    let mut root = vec![("fmiVersion", version.number().into()), ("modelName", name)];
    root.push((if version == Version::Two { "guid" } else { "instantiationToken" }, model.token.clone()));
    root.extend([("description", what.into()), ("generationTool", tool.into())]);
    root.push(("variableNamingConvention", "flat".into()));
    xml.open("fmiModelDescription", &root)?;
    co_simulation(xml, model, version)?;
    let variables: Vec<(usize, &Variable)> =
        model.variables.iter().enumerate().filter(|(_, variable)| version.takes(variable)).collect();
    let units = definitions(&model.variables, written.iter().map(|parameter| parameter.written.as_str()));
    unit_definitions(xml, &units)?;
    xml.open("LogCategories", &vec![])?;
    for (name, doc) in CATEGORIES {
        xml.empty("Category", &vec![("name", name.into()), ("description", doc.into())])?;
    }
    xml.close("LogCategories")?;
    let period = number(model.world.sampling.period);
    xml.empty("DefaultExperiment", &vec![("startTime", "0".into()), ("stepSize", period)])?;
    xml.open("ModelVariables", &vec![])?;
    for (reference, variable) in &variables {
        let shown = display_unit(variable, written, &units);
        match version {
            Version::Two => scalar_variable(xml, *reference, variable, shown)?,
            Version::Three => typed_variable(xml, *reference, variable, shown)?,
        }
    }
    xml.close("ModelVariables")?;
    structure(xml, &variables, version)?;
    xml.close("fmiModelDescription")
}

fn co_simulation(xml: &mut Xml, model: &Model, version: Version) -> io::Result<()> {
    let yes = || "true".to_string();
    let mut attributes =
        vec![("modelIdentifier", IDENTIFIER.into()), ("canHandleVariableCommunicationStepSize", yes())];
    attributes.extend(match version {
        Version::Two => vec![
            ("canNotUseMemoryManagementFunctions", yes()),
            ("canGetAndSetFMUstate", yes()),
            ("canSerializeFMUstate", yes()),
            ("providesDirectionalDerivative", yes()),
        ],
        Version::Three => vec![
            ("canGetAndSetFMUState", yes()),
            ("canSerializeFMUState", yes()),
            ("providesDirectionalDerivatives", yes()),
            ("providesAdjointDerivatives", yes()),
            ("fixedInternalStepSize", number(model.world.sampling.period)),
        ],
    });
    xml.empty("CoSimulation", &attributes)
}

fn unit_definitions(xml: &mut Xml, units: &BTreeMap<String, Definition>) -> io::Result<()> {
    xml.open("UnitDefinitions", &vec![])?;
    for (name, Definition { dimension, display }) in units {
        xml.open("Unit", &vec![("name", name.clone())])?;
        let powers = [("kg", dimension.mass), ("m", dimension.length), ("s", dimension.time), ("rad", dimension.angle)];
        let powers = powers.into_iter().filter(|(_, power)| *power != 0).map(|(base, power)| (base, power.to_string()));
        xml.empty("BaseUnit", &powers.collect())?;
        for (name, factor) in display {
            xml.empty("DisplayUnit", &vec![("name", name.clone()), ("factor", number(*factor))])?;
        }
        xml.close("Unit")?;
    }
    xml.close("UnitDefinitions")
}

/// The display unit of a variable: that of the world file, and deg for angles.
fn display_unit(variable: &Variable, written: &[Parameter], units: &BTreeMap<String, Definition>) -> Option<String> {
    let display = &units.get(&variable.unit)?.display;
    let parameter = written.iter().find(|parameter| parameter.given && parameter.path == variable.name);
    let own = parameter.and_then(|parameter| unit_of(&parameter.written));
    let default = match variable.unit.as_str() {
        "rad" => Some("deg"),
        "rad/s" => Some("deg/s"),
        _ => None,
    };
    own.or(default.filter(|_| !variable.is_parameter())).filter(|name| display.contains_key(*name)).map(str::to_string)
}

/// The common attributes of both versions.
fn common(reference: usize, variable: &Variable) -> Attributes<'static> {
    let (causality, variability) = match variable.role {
        Role::Time => ("independent", "continuous"),
        Role::Input(_) => ("input", "continuous"),
        Role::Signal(signal) if PUCK.contains(&signal) => ("output", "continuous"),
        // Held from sample to sample.
        Role::Signal(_) | Role::Body(..) => ("output", "discrete"),
        Role::Fixed => ("parameter", "fixed"),
        Role::Tunable => ("parameter", "tunable"),
    };
    let mut attributes = vec![
        ("name", variable.name.clone()),
        ("valueReference", reference.to_string()),
        ("description", variable.doc.clone()),
        ("causality", causality.into()),
        ("variability", variability.into()),
    ];
    if variable.is_parameter() {
        attributes.push(("initial", "exact".into()));
    }
    attributes
}

/// Unit, range and start.
fn values(variable: &Variable, shown: Option<String>) -> Attributes<'static> {
    let mut attributes = Vec::new();
    if let Value::Real(_) = variable.start {
        attributes.extend((!variable.unit.is_empty()).then(|| ("unit", variable.unit.clone())));
        attributes.extend(shown.map(|unit| ("displayUnit", unit)));
        attributes.extend(variable.min.map(|min| ("min", number(min))));
    }
    let has_start = match variable.role {
        Role::Input(_) | Role::Fixed | Role::Tunable => true,
        Role::Time | Role::Signal(_) | Role::Body(..) => false,
    };
    if has_start {
        attributes.push(("start", start(&variable.start)));
    }
    attributes
}

fn scalar_variable(xml: &mut Xml, reference: usize, variable: &Variable, shown: Option<String>) -> io::Result<()> {
    xml.open("ScalarVariable", &common(reference, variable))?;
    xml.empty(variable.start.type_name(), &values(variable, shown))?;
    xml.close("ScalarVariable")
}

fn typed_variable(xml: &mut Xml, reference: usize, variable: &Variable, shown: Option<String>) -> io::Result<()> {
    let attributes = common(reference, variable);
    let name = match &variable.start {
        Value::Real(_) => "Float64",
        Value::Whole(_) => "Int64",
        Value::Text(text) => {
            xml.open("String", &attributes)?;
            xml.empty("Start", &vec![("value", text.clone())])?;
            return xml.close("String");
        }
    };
    xml.empty(name, &[attributes, values(variable, shown)].concat())
}

/// The outputs: those of a loop without its device depend directly on its inputs, those of a loop on its device only later; initially all
/// depend on every variable that can be set.
fn structure(xml: &mut Xml, variables: &[(usize, &Variable)], version: Version) -> io::Result<()> {
    // FMI 2.0 counts the variables from 1, FMI 3.0 names their references.
    let label = |place: usize, reference: usize| match version {
        Version::Two => (place + 1).to_string(),
        Version::Three => reference.to_string(),
    };
    let key = if version == Version::Two { "index" } else { "valueReference" };
    let all = || variables.iter().enumerate();
    let is_loop = all().filter(|(_, (_, variable))| matches!(variable.role, Role::Input(_))).count() > 1;
    let inputs: Vec<String> = all()
        .filter(|(_, (_, variable))| is_loop && matches!(variable.role, Role::Input(_)))
        .map(|(place, (reference, _))| label(place, *reference))
        .collect();
    let outputs = || {
        let outputs = all().filter(|(_, (_, variable))| variable.is_output());
        outputs.map(|(place, (reference, _))| (key, label(place, *reference)))
    };
    let (output, initial) = match version {
        Version::Two => ("Unknown", "Unknown"),
        Version::Three => ("Output", "InitialUnknown"),
    };
    xml.open("ModelStructure", &vec![])?;
    if version == Version::Two {
        xml.open("Outputs", &vec![])?;
    }
    for unknown in outputs() {
        xml.empty(output, &vec![unknown, ("dependencies", inputs.join(" "))])?;
    }
    if version == Version::Two {
        xml.close("Outputs")?;
        xml.open("InitialUnknowns", &vec![])?;
    }
    for unknown in outputs() {
        xml.empty(initial, &vec![unknown])?;
    }
    if version == Version::Two {
        xml.close("InitialUnknowns")?;
    }
    xml.close("ModelStructure")
}

fn start(value: &Value) -> String {
    match value {
        Value::Real(value) => number(*value),
        Value::Whole(value) => value.to_string(),
        Value::Text(text) => text.clone(),
    }
}

/// The shortest digits that read back to the same double.
fn number(value: f64) -> String {
    format!("{value:?}")
}
