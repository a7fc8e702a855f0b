//! Delivery against distance, counted as the run goes, over distances whose range is not known beforehand.

/// Attempts and deliveries within a range of distances.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DistanceBin {
    /// From this distance (m), included.
    pub from_m: f64,
    /// To this distance (m), excluded.
    pub to_m: f64,
    /// Transmissions times alive receivers other than the sender.
    pub attempts: u64,
    /// How many of them were delivered.
    pub deliveries: u64,
}

/// A histogram whose bins double in width whenever a distance lies beyond the last.
#[derive(Clone, Debug)]
pub struct Distances {
    /// Attempts and deliveries, the first bin beginning at 0.
    bins: Vec<[u64; 2]>,
    /// Bins are `2^doublings` times 0.1 m wide.
    doublings: u32,
}

impl Default for Distances {
    /// No attempts yet.
    fn default() -> Self {
        Self { bins: vec![[0; 2]; N_BINS], doublings: 0 }
    }
}

impl Distances {
    /// Counts an attempt over a distance (m, finite).
    pub fn add(&mut self, distance_m: f64, delivered: bool) {
        loop {
            // Distances that rounding has put just below an edge belong above it: robots often stand in whole metres.
            let bin = (distance_m * 10.0 + EDGE) / self.scale();
            if bin < N_BINS as f64 {
                let counts = &mut self.bins[bin as usize];
                counts[0] += 1;
                counts[1] += u64::from(delivered);
                return;
            }
            for index in 0..N_BINS / 2 {
                let [a, b] = [self.bins[2 * index], self.bins[2 * index + 1]];
                self.bins[index] = [a[0] + b[0], a[1] + b[1]];
            }
            self.bins[N_BINS / 2..].fill([0; 2]);
            self.doublings += 1;
        }
    }

    /// Width of a bin in units of 0.1 m.
    fn scale(&self) -> f64 {
        (1u64 << self.doublings) as f64
    }

    /// At most `max_bins` bins of one round width from 0 to the greatest distance; those without attempts left out.
    pub fn table(&self, max_bins: usize) -> Vec<DistanceBin> {
        let n = self.bins.iter().rposition(|bin| bin[0] != 0).map_or(0, |last| last + 1);
        let merged = [1, 2, 5]
            .into_iter()
            .cycle()
            .zip((0u32..).flat_map(|power| [power; 3]))
            .map(|(digit, power)| digit * 10usize.pow(power))
            .find(|merged| n <= merged * max_bins)
            .unwrap_or(n);
        let edge_m = |index: usize| (index * merged) as f64 * self.scale() / 10.0;
        self.bins[..n]
            .chunks(merged)
            .enumerate()
            .map(|(index, bins)| DistanceBin {
                from_m: edge_m(index),
                to_m: edge_m(index + 1),
                attempts: bins.iter().map(|bin| bin[0]).sum(),
                deliveries: bins.iter().map(|bin| bin[1]).sum(),
            })
            .filter(|bin| bin.attempts != 0)
            .collect()
    }
}

impl DistanceBin {
    /// Share of the attempts that were delivered.
    #[must_use]
    pub fn ratio(&self) -> f64 {
        self.deliveries as f64 / self.attempts as f64
    }

    /// The 95 % interval of the delivery probability, taking attempts for independent (Wilson 1927, without continuity
    /// correction).
    #[must_use]
    pub fn interval(&self) -> [f64; 2] {
        // The 97.5 % quantile of the normal distribution.
        let z = 1.959_963_984_540_054;
        let (n, p) = (self.attempts as f64, self.ratio());
        let centre = p + z * z / (2.0 * n);
        let half = z * libm::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n));
        let scale = 1.0 + z * z / n;
        let [low, high] = [(centre - half) / scale, (centre + half) / scale];
        // Where none or all were delivered, an end is 0 or 1, which rounding would miss.
        [
            if self.deliveries == 0 { 0.0 } else { low.max(0.0) },
            if self.deliveries == self.attempts { 1.0 } else { high.min(1.0) },
        ]
    }
}

/// How far below an edge a distance still counts as on it, in units of 0.1 m: a tenth of a micrometre.
const EDGE: f64 = 1e-6;
/// Bins held: 512 m in steps of 0.1 m, then 1024 m in steps of 0.2 m, and so on.
const N_BINS: usize = 5120;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_lost_when_the_range_grows() {
        let mut distances = Distances::default();
        for i in 0..10_000u32 {
            distances.add(f64::from(i) * 0.37, i % 3 == 0);
        }
        let table = distances.table(30);
        assert!(table.len() <= 30);
        assert_eq!(table.iter().map(|bin| bin.attempts).sum::<u64>(), 10_000);
        assert_eq!(table.iter().map(|bin| bin.deliveries).sum::<u64>(), 3334);
        for bin in &table {
            let expected = (0..10_000u32)
                .map(|i| f64::from(i) * 0.37)
                .filter(|d| (bin.from_m..bin.to_m).contains(d))
                .count();
            assert_eq!(bin.attempts as usize, expected, "{bin:?}");
        }
    }

    #[test]
    fn widths_are_round() {
        let mut distances = Distances::default();
        (0..=90).for_each(|metre| distances.add(f64::from(metre), true));
        let table = distances.table(30);
        assert_eq!((table[0].from_m, table[0].to_m), (0.0, 5.0));
        assert_eq!(table.last().map(|bin| (bin.from_m, bin.to_m)), Some((90.0, 95.0)));
    }

    #[test]
    fn intervals_are_those_of_wilson() {
        // Newcombe, Statistics in Medicine 17 (1998), table I, method 3: 81 of 263, 15 of 148, 0 of 20, 1 of 29; given to four
        // digits, hence the tolerance.
        for (deliveries, attempts, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let bin = DistanceBin { deliveries, attempts, ..DistanceBin::default() };
            let [l, h] = bin.interval();
            assert!((l - low).abs() < 5e-5 && (h - high).abs() < 5e-5, "{deliveries}: {l} {h}");
        }
        let all = DistanceBin { deliveries: 426, attempts: 426, ..DistanceBin::default() };
        assert_eq!(all.interval()[1], 1.0);
    }
}
