//! Manifests of layered standards (FMI 3.0.2, 2.6).

use crate::check::Verdict;
use crate::fmu_file::FmuFile;
use crate::zip_headers::contents;
use fmu_import::limits;
use model_description::Element;

/// Namespace of the attributes of a manifest.
const NAMESPACE: &str = "http://fmi-standard.org/fmi-ls-manifest";
const ATTRIBUTES: [&str; 3] = ["fmi-ls-name", "fmi-ls-version", "fmi-ls-description"];

pub(crate) fn manifests(fmu: &FmuFile) -> Verdict {
    let (mut findings, mut any) = (Vec::new(), false);
    for entry in &fmu.zip.entries {
        let name = entry.name();
        if !name.starts_with("extra/") || !name.ends_with("/fmi-ls-manifest.xml") {
            continue;
        }
        any = true;
        let text = contents(&fmu.source, entry, limits::XML.most);
        let text = text.and_then(|t| String::from_utf8(t).map_err(|_| "is not UTF-8".to_owned()));
        match text.and_then(|t| Element::parse(&t).map_err(|e| e.to_string())) {
            Err(cause) => findings.push(format!("{name}: {cause}")),
            Ok(root) => findings.extend(of(&root).into_iter().map(|f| format!("{name}: {f}"))),
        }
    }
    if any { Verdict::of(findings) } else { Verdict::NotApplicable("there is no extra/*/fmi-ls-manifest.xml".into()) }
}

fn of(root: &Element) -> Vec<String> {
    let prefix = root
        .attributes
        .iter()
        .find_map(|(name, value)| name.strip_prefix("xmlns:").filter(|_| value == NAMESPACE).map(str::to_owned));
    let Some(prefix) = prefix else { return vec![format!("the namespace {NAMESPACE} is not declared")] };
    let missing = |name: &&&str| root.get(&format!("{prefix}:{name}")).is_none_or(|value| value.trim().is_empty());
    ATTRIBUTES.iter().filter(missing).map(|name| format!("the attribute {prefix}:{name} is missing or empty")).collect()
}
