//! Latitude and longitude as metres in the plane.

/// The ellipsoid of WGS 84: semi-major axis (m) and flattening (NGA.STND.0036, table 3.1).
const SEMI_MAJOR_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Fixes further than this from the origin (m) are refused: there the plane lies 800 m above the ground.
pub const FARTHEST_M: f64 = 100_000.0;

/// A plane that touches the ellipsoid at a point: x east, y north, z up.
///
/// # Model
///
/// Geographic coordinates become geocentric ones (EPSG method 9602), which are rotated into the topocentric system of the origin
/// (EPSG method 9836); IOGP publication 373-7-2, sections on both methods.
///
/// # Validity
///
/// All fixes are taken to lie on the ellipsoid: at an altitude of 1 km, distances are too short by 0.016 %.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentPlane {
    /// Latitude and longitude of the origin (degrees).
    pub origin_deg: [f64; 2],
    geocentric_m: [f64; 3],
}

impl TangentPlane {
    /// The plane that touches the ellipsoid at latitude and longitude (degrees).
    #[must_use]
    pub fn at(origin_deg: [f64; 2]) -> Self {
        Self { origin_deg, geocentric_m: geocentric(origin_deg, 0.0) }
    }

    /// Metres east and north of the origin.
    #[must_use]
    pub fn east_north_m(&self, fix_deg: [f64; 2]) -> [f64; 2] {
        let [east_m, north_m, _] = self.topocentric_m(geocentric(fix_deg, 0.0));
        [east_m, north_m]
    }

    fn topocentric_m(&self, geocentric_m: [f64; 3]) -> [f64; 3] {
        let [x, y, z] = std::array::from_fn(|axis| geocentric_m[axis] - self.geocentric_m[axis]);
        let [(sin_lat, cos_lat), (sin_lon, cos_lon)] =
            self.origin_deg.map(|angle| libm::sincos(angle.to_radians()));
        [
            -sin_lon * x + cos_lon * y,
            -sin_lat * cos_lon * x - sin_lat * sin_lon * y + cos_lat * z,
            cos_lat * cos_lon * x + cos_lat * sin_lon * y + sin_lat * z,
        ]
    }
}

/// Geocentric Cartesian coordinates (m) of latitude and longitude (degrees) and height above the ellipsoid (m).
fn geocentric(fix_deg: [f64; 2], height_m: f64) -> [f64; 3] {
    let [(sin_lat, cos_lat), (sin_lon, cos_lon)] =
        fix_deg.map(|angle| libm::sincos(angle.to_radians()));
    let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
    let radius_m = SEMI_MAJOR_M / (1.0 - eccentricity_squared * sin_lat * sin_lat).sqrt();
    [
        (radius_m + height_m) * cos_lat * cos_lon,
        (radius_m + height_m) * cos_lat * sin_lon,
        ((1.0 - eccentricity_squared) * radius_m + height_m) * sin_lat,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The worked example of IOGP publication 373-7-2, geographic to topocentric coordinates.
    #[test]
    fn the_example_of_the_standard_comes_out() {
        let origin =
            TangentPlane { origin_deg: [55.0, 5.0], geocentric_m: geocentric([55.0, 5.0], 200.0) };
        let fix_deg = [53.0 + 48.0 / 60.0 + 33.82 / 3600.0, 2.0 + 7.0 / 60.0 + 46.38 / 3600.0];
        let found = origin.topocentric_m(geocentric(fix_deg, 73.0));
        // The coordinates are stated to 1 mm, the angles to 0.01 seconds of arc, which are 0.3 m on the ground at most.
        for (found, expected) in found.into_iter().zip([-189_013.869, -128_642.040, -4_220.171]) {
            assert!((found - expected).abs() < 2e-3, "{found} {expected}");
        }
    }

    #[test]
    fn a_thousandth_of_a_degree_is_111_m_north_at_the_middle_latitudes() {
        let [east_m, north_m] = TangentPlane::at([45.0, 7.0]).east_north_m([45.001, 7.0]);
        // A degree of the meridian at 45° is 111.132 km (Bowditch, table 7).
        assert!(east_m.abs() < 1e-6 && (north_m - 111.13).abs() < 0.01, "{east_m} {north_m}");
    }
}
