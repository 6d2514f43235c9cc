//! Tables of values of connections, and of variables that are recorded through a transformation.

use super::Column;
use super::parts::{Parts, Port, family, kind};
use super::wiring::{Change, Outlet, Transformation};
use fmu_import::{Error, Number, Values};

impl Parts {
    /// A column for a recorded variable, with its unit after the change.
    pub(super) fn outlet(&self, port: &Port, outlet: &Outlet) -> Column {
        let column = self.column(port, &outlet.name);
        let Some(transformation) = &outlet.transformation else {
            // The connector of a system may have a unit that no file defines: numbers pass unchanged, and mean that unit.
            let stated = outlet.unit.clone().filter(|unit| *unit != column.unit);
            return stated.map(|unit| Column { unit, display: None, ..column.clone() }).unwrap_or(column);
        };
        let unit = outlet.unit.clone().unwrap_or_default();
        let items = if let Transformation::Table(_) = transformation { outlet.items.clone() } else { Vec::new() };
        Column { unit, display: None, items, ..column }
    }

    /// A table between two variables of one number each; the source is an integer, a Boolean or an enumeration.
    pub(super) fn table(
        &self,
        [(from, source), (to, target)]: [(&str, &Port); 2],
        table: &[(String, String)],
    ) -> Result<Change, Error> {
        check_table(from, source)?;
        check_table(to, target)?;
        let entry = |(one, other): &(String, String)| {
            let taken = self.read(target, other)?.map_err(|cause| Error::usage(to, cause))?;
            // The table may have values that the source lacks.
            Ok::<_, Error>(self.read(source, one)?.ok().map(|sent| (sent, taken)))
        };
        let entries: Vec<Option<_>> = table.iter().map(entry).collect::<Result<_, _>>()?;
        let keeps = family(source.base) == family(target.base) || widens(source, target);
        Ok(Change::Table { entries: entries.into_iter().flatten().collect(), keeps })
    }

    /// A text as the number of a port, or why this fails.
    fn read(&self, port: &Port, text: &str) -> Result<Result<Number, String>, Error> {
        let description = self.0[port.instance].description();
        let values = Values::read(text, self.variable(port.instance, &port.name)?, description);
        Ok(values.map(|values| values.one(0)))
    }

    /// The change of a variable that is recorded through a transformation.
    pub(super) fn change(&self, port: &Port, outlet: &Outlet) -> Result<Option<Change>, Error> {
        let table = match &outlet.transformation {
            None => return Ok(None),
            Some(Transformation::Linear(conversion)) => {
                if kind(port.base).is_none_or(|kind| !"ri".contains(kind)) {
                    return Err(Error::usage(&outlet.port, "is not a number, which a linear transformation needs"));
                }
                return Ok(Some(Change::Linear(*conversion)));
            }
            Some(Transformation::Table(table)) => table,
        };
        check_table(&outlet.port, port)?;
        let taken = |text: &String| {
            let item = outlet.items.iter().find(|(_, name)| name == text);
            let number = item.map(|(value, _)| i128::from(*value)).or_else(|| text.parse().ok()).map(Number::Integer);
            let number = match text.as_str() {
                "true" => Some(Number::Boolean(true)),
                "false" => Some(Number::Boolean(false)),
                _ => number,
            };
            let cause = || format!("{text} is neither a number, true or false, nor an item of the system's connector");
            number.ok_or_else(|| Error::usage(&outlet.name, cause()))
        };
        let mut entries = Vec::new();
        for (sent, text) in &**table {
            entries.extend(self.read(port, sent)?.ok().map(|sent| Ok((sent, taken(text)?))));
        }
        let entries = entries.into_iter().collect::<Result<_, Error>>()?;
        Ok(Some(Change::Table { entries, keeps: true }))
    }
}

/// An integer feeds a real number.
pub(super) fn widens(source: &Port, target: &Port) -> bool {
    matches!((family(source.base), family(target.base)), ('i', 'r'))
}

/// A table maps one integer, Boolean or item to another.
fn check_table(name: &str, port: &Port) -> Result<(), Error> {
    if port.is_whole() || kind(port.base).is_none_or(|kind| kind == 'c') {
        return Err(Error::usage(name, "is not one number, which a table of values needs"));
    }
    if port.base.is_float() {
        return Err(Error::usage(name, "is a real number: a table of values needs an integer, a Boolean or an item"));
    }
    Ok(())
}
