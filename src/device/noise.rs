//! Seeded noise that is the same on every machine.

/// PCG-XSH-RR 64/32 (O'Neill 2014, HMC-CS-2014-0905): 32 good random bits per step from 64 bits of state.
///
/// Written out here because a seed must give the same stall, flip and noise on every machine and with every
/// version of every dependency.
#[derive(Clone, Debug)]
pub struct Noise {
    state: u64,
    /// Second half of the last Box-Muller pair.
    spare_normal: Option<f64>,
}

impl Noise {
    const MULTIPLIER: u64 = 6_364_136_223_846_793_005;
    const INCREMENT: u64 = 1_442_695_040_888_963_407;

    /// A stream chosen by `seed`; every seed, 0 included, gives full noise.
    pub fn new(seed: u64) -> Self {
        let mut noise = Self { state: seed.wrapping_add(Self::INCREMENT), spare_normal: None };
        noise.next_u32();
        noise
    }

    /// The next 32 random bits.
    pub fn next_u32(&mut self) -> u32 {
        let old = self.state;
        self.state = old.wrapping_mul(Self::MULTIPLIER).wrapping_add(Self::INCREMENT);
        let xorshifted = (((old >> 18) ^ old) >> 27) as u32;
        xorshifted.rotate_right((old >> 59) as u32)
    }

    /// Uniform in [0, 1), steps of 2⁻³².
    pub fn uniform(&mut self) -> f64 {
        f64::from(self.next_u32()) * (1.0 / 4_294_967_296.0)
    }

    /// True with the given probability; never for 0, always for 1.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.uniform() < probability
    }

    /// Normal with mean 0 and standard deviation 1 (Box-Muller).
    pub fn normal(&mut self) -> f64 {
        if let Some(spare) = self.spare_normal.take() {
            return spare;
        }
        // 1 - u lies in (0, 1], so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        let (sin, cos) = libm::sincos(core::f64::consts::TAU * self.uniform());
        self.spare_normal = Some(radius * sin);
        radius * cos
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_reference_vector_of_pcg32_is_met() {
        // `pcg32-global-demo` of the PCG C library: seed 42, sequence 54.
        let mut noise = Noise { state: 0, spare_normal: None };
        let increment = (54u64 << 1) | 1;
        let step = |state: u64| state.wrapping_mul(Noise::MULTIPLIER).wrapping_add(increment);
        noise.state = step(step(0).wrapping_add(42));
        assert_eq!(noise.next_u32(), 0xa15c_02b7);
    }

    #[test]
    fn a_seed_fixes_the_stream_and_different_seeds_differ() {
        let draw = |seed| {
            let mut noise = Noise::new(seed);
            [noise.next_u32(), noise.next_u32(), noise.next_u32()]
        };
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
        assert_ne!(draw(0), [0; 3]);
    }

    #[test]
    fn normal_has_mean_zero_and_unit_variance() {
        let mut noise = Noise::new(1);
        let count = 100_000;
        let (mut sum, mut sum_squares) = (0.0, 0.0);
        for _ in 0..count {
            let value = noise.normal();
            sum += value;
            sum_squares += value * value;
        }
        let (mean, mean_square) = (sum / f64::from(count), sum_squares / f64::from(count));
        // Five standard errors of each.
        assert!(mean.abs() < 5.0 / f64::from(count).sqrt(), "mean {mean}");
        assert!((mean_square - 1.0).abs() < 5.0 * (2.0 / f64::from(count)).sqrt(), "variance {mean_square}");
    }

    #[test]
    fn chance_keeps_its_ends() {
        let mut noise = Noise::new(3);
        assert!((0..1000).all(|_| !noise.chance(0.0) && noise.chance(1.0)));
    }
}
