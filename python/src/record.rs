//! Rows of a result in the layout of NumPy's structured arrays: one packed record of bytes per sample.

use fmu_import::{Error, Instance, Values};
use model_description::BaseType;

/// Variables of one type, read together.
pub(crate) struct Group {
    pub(crate) base: BaseType,
    /// Value reference and number of elements of each variable.
    pub(crate) variables: Vec<(u32, usize)>,
}

/// The recorded samples.
pub(crate) struct Record {
    groups: Vec<Group>,
    /// References and buffer of each group of double-precision scalars.
    fast: Vec<Option<(Vec<u32>, Vec<f64>)>>,
    fmi2: bool,
    pub(crate) bytes: Vec<u8>,
    pub(crate) rows: usize,
}

impl Record {
    pub(crate) fn new(groups: Vec<Group>, fmi2: bool) -> Self {
        let scalars = |g: &Group| g.base == BaseType::Float64 && g.variables.iter().all(|(_, n)| *n == 1);
        let buffers = |g: &Group| (g.variables.iter().map(|(r, _)| *r).collect(), vec![0.0; g.variables.len()]);
        let fast = groups.iter().map(|g| scalars(g).then(|| buffers(g))).collect();
        Self { groups, fast, fmi2, bytes: Vec::new(), rows: 0 }
    }

    /// Reads the variables and appends a row.
    pub(crate) fn sample(&mut self, instance: &mut Instance, time: f64) -> Result<(), Error> {
        let begin = self.bytes.len();
        self.bytes.extend(time.to_ne_bytes());
        let sampled = self.append(instance);
        if sampled.is_err() {
            self.bytes.truncate(begin);
        } else {
            self.rows += 1;
        }
        sampled
    }

    fn append(&mut self, instance: &mut Instance) -> Result<(), Error> {
        for (group, fast) in self.groups.iter().zip(&mut self.fast) {
            if let Some((references, values)) = fast {
                instance.get_reals(references, values)?;
                self.bytes.extend(values.iter().flat_map(|x| x.to_ne_bytes()));
                continue;
            }
            for &(reference, count) in &group.variables {
                let values = instance.get_at(group.base, reference, count)?;
                append(&mut self.bytes, group.base, self.fmi2, values);
            }
        }
        Ok(())
    }
}

/// Appends values in the width of their type; enumerations have 32 bits in FMI 2.0, 64 in FMI 3.0.
fn append(bytes: &mut Vec<u8>, base: BaseType, fmi2: bool, values: Values) {
    /// Integers in the width of a type, as received by the importer.
    fn integers<const N: usize>(bytes: &mut Vec<u8>, values: &[i128], cut: impl Fn(i128) -> [u8; N]) {
        bytes.extend(values.iter().flat_map(|&x| cut(x)));
    }
    macro_rules! of {
        ($values:expr, $t:ty) => {
            integers(bytes, $values, |x| <$t>::try_from(x).unwrap_or_default().to_ne_bytes())
        };
    }
    match values {
        Values::Reals(x) if base == BaseType::Float32 => {
            #[expect(clippy::cast_possible_truncation, reason = "they were single-precision before")]
            bytes.extend(x.iter().flat_map(|&x| (x as f32).to_ne_bytes()));
        }
        Values::Reals(x) => bytes.extend(x.iter().flat_map(|x| x.to_ne_bytes())),
        Values::Booleans(x) => bytes.extend(x.into_iter().map(u8::from)),
        Values::Integers(x) => match base {
            BaseType::Int8 => of!(&x, i8),
            BaseType::UInt8 => of!(&x, u8),
            BaseType::Int16 => of!(&x, i16),
            BaseType::UInt16 => of!(&x, u16),
            BaseType::Int32 => of!(&x, i32),
            BaseType::UInt32 => of!(&x, u32),
            BaseType::UInt64 => of!(&x, u64),
            BaseType::Enumeration if fmi2 => of!(&x, i32),
            _ => of!(&x, i64),
        },
        Values::Strings(_) | Values::Binaries(_) => {}
    }
}
