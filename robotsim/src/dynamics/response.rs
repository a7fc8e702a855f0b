//! How actuators come to what they are asked for.

/// How one actuator, or the three of a point mass that act along one direction, approaches a steady demand.
///
/// # Model
///
/// With e the distance between what is asked for and what the actuator does,
///
/// ```text
/// de/dt = −min(e / lag_s, limit)
/// ```
///
/// Solved exactly: a ramp at the limit while e exceeds limit × lag, an exponential below.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Response {
    /// Time constant (s). 0: none.
    pub lag_s: f64,
    /// Greatest rate of change, per second. Infinite: none.
    pub limit: f64,
}

impl Response {
    /// Actuators that follow commands at once: no lag, no limit.
    pub const INSTANT: Self = Self { lag_s: 0.0, limit: f64::INFINITY };

    /// What remains, of a distance `e`, after `t_s`, and its integral over that time.
    #[must_use]
    pub fn remaining(&self, e: f64, t_s: f64) -> (f64, f64) {
        let knee = self.limit * self.lag_s;
        // No lag and no limit: 0 × infinity is no number, and there is no ramp.
        let ramp_s = if self.limit.is_finite() { ((e - knee) / self.limit).max(0.0) } else { 0.0 };
        if t_s < ramp_s {
            return (e - self.limit * t_s, t_s * (e - 0.5 * self.limit * t_s));
        }
        let ramp = if ramp_s == 0.0 { 0.0 } else { ramp_s * (e - 0.5 * self.limit * ramp_s) };
        if self.lag_s == 0.0 {
            return (0.0, ramp);
        }
        let left = if ramp_s == 0.0 { e } else { knee };
        let decay = libm::expm1((ramp_s - t_s) / self.lag_s);
        (left * (1.0 + decay), ramp - left * self.lag_s * decay)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Euler steps of 1 µs, written out from the law itself.
    fn plain(response: Response, mut e: f64, t_s: f64) -> (f64, f64) {
        let h = 1e-6;
        let mut integral = 0.0;
        for _ in 0..(t_s / h).round() as usize {
            let rate =
                response.limit.min(if response.lag_s == 0.0 { e / h } else { e / response.lag_s });
            integral += h * (e - 0.5 * h * rate);
            e -= h * rate;
        }
        (e, integral)
    }

    #[test]
    fn what_remains_is_what_small_steps_leave() {
        for lag_s in [0.0, 0.2] {
            for limit in [1.5, 4.0, f64::INFINITY] {
                for e in [0.0, 0.1, 1.0] {
                    for t_s in [0.05, 0.1, 0.5, 2.0] {
                        let response = Response { lag_s, limit };
                        let (left, integral) = response.remaining(e, t_s);
                        let expected = plain(response, e, t_s);
                        // Steps of 1 µs err by about 1 µs × rate.
                        assert!((left - expected.0).abs() < 1e-5, "{response:?} {e} {t_s}");
                        assert!((integral - expected.1).abs() < 1e-5, "{response:?} {e} {t_s}");
                    }
                }
            }
        }
    }
}
