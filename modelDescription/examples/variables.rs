//! Lists the variables of a modelDescription.xml: `cargo run -p model-description --example variables FILE`.

use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("expected the path of a modelDescription.xml")?;
    let description = model_description::read(std::fs::read(&path)?)?;
    println!("{} (FMI {:?})", description.model_name, description.version);
    for v in &description.variables {
        let start = v.start.as_deref().map(|start| format!(" = {start}")).unwrap_or_default();
        println!("{:?} {:?} {}{start}: {}", v.causality, v.base, v.name, v.description.as_deref().unwrap_or(""));
    }
    Ok(())
}
