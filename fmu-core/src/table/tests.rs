//! A table of thousands of rows, many of them arrays.
#![expect(clippy::large_const_arrays, clippy::large_stack_arrays, reason = "only while compiling")]
#![expect(clippy::float_cmp, reason = "values as they were set")]

use super::*;
use crate::unit::VOLT;

const N: usize = 5000;

#[derive(Clone)]
struct Large {
    x: f64,
    few: [f64; 3],
    many: [f64; 200],
}

/// "v0000v0001...": the names of the rows.
const NAMES: &str = {
    const TEXT: [u8; 5 * N] = {
        let (mut text, mut i) = ([b'v'; 5 * N], 0);
        while i < N {
            let (mut digit, mut rest) = (4, i);
            while digit > 0 {
                text[5 * i + digit] = b"0123456789"[rest % 10];
                (digit, rest) = (digit - 1, rest / 10);
            }
            i += 1;
        }
        text
    };
    match std::str::from_utf8(&TEXT) {
        Ok(text) => text,
        Err(_) => "",
    }
};

const fn name(i: usize) -> &'static str {
    NAMES.split_at(5 * i).1.split_at(5).0
}

/// Every tenth row is an array, every hundredth a wide one.
const fn rows() -> [Row<Large>; N] {
    let mut rows = [const { Row::input("x", &VOLT, "", |m: &mut Large| &mut m.x) }; N];
    let mut i = 0;
    while i < N {
        if i % 100 == 0 {
            rows[i] = Row::array_parameter(name(i), &VOLT, "", 200, |m| &mut m.many);
        } else if i % 10 == 0 {
            rows[i] = Row::array_parameter(name(i), &VOLT, "", 3, |m| &mut m.few);
        }
        rows[i].meta.name = name(i);
        i += 1;
    }
    rows
}

const TABLE: &Table<Large> = &Table::new(const { &numbered(rows()) });
const PART: &Table<Large> = table![Row::part("part.", &Part { table: TABLE, lens: |m: &mut Large| m }), {
    Row::input("last", &VOLT, "", |m: &mut Large| &mut m.x)
}];

#[test]
fn a_table_has_thousands_of_rows() {
    assert_eq!((TABLE.len(), TABLE.wide()), (N - N / 10 + 3 * (N / 10 - N / 100), 200 * (N / 100)));
    let mut large = Large {
        x: 1.0,
        few: [2.0, 3.0, 4.0],
        many: std::array::from_fn(|i| 0.5 + f64::from(u8::try_from(i).unwrap())),
    };
    let (mut index, mut wide) = (0, WIDE);
    for i in 0..N {
        let (n, at) = match i {
            _ if i % 100 == 0 => (200, &mut wide),
            _ if i % 10 == 0 => (3, &mut index),
            _ => (1, &mut index),
        };
        for element in 0..n {
            let expected = match n {
                200 => large.many[element],
                3 => large.few[element],
                _ => large.x,
            };
            assert_eq!(TABLE.locate(*at).map(|(name, _, element)| (name, element)), Some((name(i).into(), element)));
            let value = |slot: Option<(_, Slot<'_>)>| matches!(slot, Some((_, Slot::Real(x))) if *x == expected);
            assert!(value(TABLE.entry(&mut large, *at)) && value(PART.entry(&mut large, *at)), "{i}, {element}");
            *at += 1;
        }
    }
    for beyond in [index, wide] {
        assert!(TABLE.entry(&mut large, beyond).is_none() && TABLE.locate(beyond).is_none());
    }
    assert_eq!(PART.locate(index).map(|(name, ..)| name), Some("last".into()));
}

/// References of arrays would change with the limit.
#[test]
fn an_array_of_more_than_128_elements_is_wide() {
    const DENSE: &Table<[f64; 128]> = table![Row::array_parameter("x", &VOLT, "", 128, |m: &mut [f64; 128]| m)];
    const WIDE: &Table<[f64; 129]> = table![Row::array_parameter("x", &VOLT, "", 129, |m: &mut [f64; 129]| m)];
    assert_eq!([(DENSE.len(), DENSE.wide()), (WIDE.len(), WIDE.wide())], [(128, 0), (0, 129)]);
}
