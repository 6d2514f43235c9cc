//! Incremental encoder: two tracks in quadrature and an index.
//!
//! ```text
//! p = (angle - offset) / 2 pi counts          count = floor(p) mod counts, turns = floor(p / counts)
//! count mod 4:  0  1  2  3
//!           A:  0  1  1  0
//!           B:  0  0  1  1            A leads B at a positive speed; index = 1 at count 0
//! ```
//!
//! Angles in rad, mechanical and not wrapped.

use std::f64::consts::TAU;

/// Incremental encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Encoder {
    /// Edges of both tracks per turn: four times the lines; a multiple of 4, at least 4.
    pub counts: u32,
    /// Mechanical angle at which count 0 begins, in rad.
    pub offset: f64,
}

/// What an encoder shows at an instant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderReading {
    /// Count within the turn, from 0 to `counts` - 1.
    pub count: u32,
    /// Whole turns.
    pub turns: i32,
    /// Track A.
    pub a: bool,
    /// Track B.
    pub b: bool,
    /// Index, once per turn.
    pub index: bool,
}

impl Encoder {
    /// The reading at the mechanical `angle` (rad).
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited; turns saturate")]
    pub fn read(&self, angle: f64) -> EncoderReading {
        let turn = (angle - self.offset) / TAU;
        let turns = turn.floor();
        let last = self.counts.max(1) - 1;
        let count = (((turn - turns) * f64::from(self.counts)).floor() as u32).min(last);
        let quarter = count % 4;
        EncoderReading {
            count,
            turns: turns as i32,
            a: quarter == 1 || quarter == 2,
            b: quarter >= 2,
            index: count == 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ENCODER: Encoder = Encoder { counts: 4096, offset: 0.1 };

    #[test]
    fn counts_follow_the_angle_in_both_directions() {
        let at = |count: f64| ENCODER.read(0.1 + count / 4096.0 * TAU);
        for (position, count, turns) in
            [(0.5, 0, 0), (1.5, 1, 0), (4095.5, 4095, 0), (4096.5, 0, 1), (-0.5, 4095, -1), (-4096.5, 4095, -2)]
        {
            let reading = at(position);
            assert_eq!((reading.count, reading.turns), (count, turns), "{position}");
            assert_eq!(reading.index, count == 0);
        }
        assert_eq!(ENCODER.read(f64::MAX).turns, i32::MAX);
    }

    /// One track changes at each count, and A leads B forward.
    #[test]
    fn the_tracks_are_in_quadrature() {
        let tracks = |k: i32| {
            let reading = ENCODER.read(0.1 + (f64::from(k) + 0.5) / 4096.0 * TAU);
            (reading.a, reading.b)
        };
        for k in -9..9 {
            let ((a, b), (a_next, b_next)) = (tracks(k), tracks(k + 1));
            assert!((a != a_next) != (b != b_next), "{k}");
            if !a && a_next {
                assert!(!b, "{k}: A rises while B is low");
            }
        }
    }
}
