//! Colours, those of the page (`orchestrator/page/src/swarm/colours.ts`).

/// A colour with its opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Colour {
    /// Red, green and blue.
    pub rgb: [u8; 3],
    /// From 0, transparent, to 1.
    pub opacity: f32,
}

impl Colour {
    /// An opaque colour, as in `0xe69f00`.
    #[must_use]
    pub const fn of(rgb: u32) -> Self {
        Self { rgb: [(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8], opacity: 1.0 }
    }

    /// The same with another opacity.
    #[must_use]
    pub const fn with_opacity(self, opacity: f32) -> Self {
        Self { opacity, ..self }
    }

    /// The colour between this one, at 0, and another, at 1.
    #[must_use]
    pub fn mixed(self, other: Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        let rgb = [0, 1, 2]
            .map(|i| libm::round(mix(f64::from(self.rgb[i]), f64::from(other.rgb[i]))) as u8);
        Self { rgb, opacity: mix(f64::from(self.opacity), f64::from(other.opacity)) as f32 }
    }

    /// What is seen of it over an opaque colour.
    #[must_use]
    pub fn over(self, below: Self) -> Self {
        below.mixed(self.with_opacity(1.0), f64::from(self.opacity))
    }
}

/// Okabe and Ito's colours, which people with colour-blindness can tell apart, in the order in which groups are given them.
const CATEGORIES: [u32; 7] = [0x0072b2, 0xe69f00, 0x009e73, 0xcc79a7, 0x56b4e9, 0xd55e00, 0xf0e442];

const VIRIDIS: [u32; 10] = [
    0x440154, 0x482878, 0x3e4a89, 0x31688e, 0x26828e, 0x1f9e89, 0x35b779, 0x6ece58, 0xb5de2b,
    0xfde725,
];

/// Shades of links.
pub const SHADES: usize = 24;

/// Colours of one theme.
#[derive(Clone, Debug)]
pub struct Theme {
    /// Behind everything.
    pub background: Colour,
    /// Titles, and numbers of robots.
    pub text: Colour,
    /// Axes and legends.
    pub faint_text: Colour,
    /// Lines at the ticks.
    pub grid: Colour,
    /// Walls.
    pub wall: Colour,
    /// Edges of obstacles.
    pub obstacle: Colour,
    /// Insides of obstacles.
    pub obstacle_fill: Colour,
    /// Obstacles of which only the radio knows.
    pub hidden: Colour,
    /// Obstacles that a diagnosis estimated.
    pub estimated: Colour,
    /// Trees and bushes.
    pub foliage: Colour,
    /// Lost robots, and links without a value.
    pub lost: Colour,
    /// The lowest ground.
    pub low_ground: Colour,
    /// The highest ground.
    pub high_ground: Colour,
    /// Links, from the least value to the greatest.
    pub links: [Colour; SHADES],
    /// Groups of robots, again from the first after the last.
    pub groups: [Colour; 7],
}

impl Theme {
    /// The light theme or the dark one.
    #[must_use]
    pub fn new(is_dark: bool) -> Self {
        let by_theme = |light, dark| Colour::of(if is_dark { dark } else { light });
        let [from, to] = if is_dark { [0.25, 1.0] } else { [0.0, 0.9] };
        let shade = |at: f64| {
            let at = (from + (to - from) * at) * (VIRIDIS.len() - 1) as f64;
            let low = (at as usize).min(VIRIDIS.len() - 2);
            let mixed =
                Colour::of(VIRIDIS[low]).mixed(Colour::of(VIRIDIS[low + 1]), at - low as f64);
            mixed.with_opacity(0.6)
        };
        let obstacle = by_theme(0x59_636e, 0x9a_a4af);
        let mut groups = CATEGORIES.map(Colour::of);
        groups[0] = by_theme(CATEGORIES[0], 0x4a_a3e0);
        Self {
            background: by_theme(0xff_ffff, 0x14_171b),
            text: by_theme(0x1b_1f24, 0xe6_e8eb),
            faint_text: by_theme(0x5b_6570, 0x9a_a4af),
            grid: by_theme(0, 0xff_ffff).with_opacity(if is_dark { 0.08 } else { 0.07 }),
            wall: by_theme(0x30_363d, 0xc9_d1d9),
            obstacle,
            obstacle_fill: obstacle.with_opacity(0.3),
            hidden: Colour::of(0xd5_5e00),
            estimated: by_theme(0x00_9e73, 0x2f_c39a),
            foliage: Colour::of(0x00_9e73).with_opacity(if is_dark { 0.3 } else { 0.22 }),
            lost: by_theme(0x6e_7781, 0x8b_949e),
            low_ground: by_theme(0xfb_faf6, 0x1b_2126),
            high_ground: by_theme(0xcd_bd97, 0x4c_4536),
            links: std::array::from_fn(|i| shade(i as f64 / (SHADES - 1) as f64)),
            groups,
        }
    }

    /// The colour of a group.
    #[must_use]
    pub fn group(&self, group: usize) -> Colour {
        self.groups[group % self.groups.len()]
    }

    /// The colour of a link with a value between two others.
    #[must_use]
    pub fn link(&self, value: f64, [least, most]: [f64; 2]) -> Colour {
        let share = ((value - least) / (most - least)).clamp(0.0, 1.0);
        self.links[libm::round(share * (SHADES - 1) as f64) as usize]
    }

    /// At most 255 colours that come near everything that is painted with these: each over the background, and, as at edges, in part.
    #[must_use]
    pub fn palette(&self) -> Vec<[u8; 3]> {
        let mut palette = vec![self.background.rgb];
        let mut add = |colour: Colour, over: Colour, parts: u32| {
            for part in 1..=parts {
                let colour = over.mixed(colour.over(over), f64::from(part) / f64::from(parts));
                if !palette.contains(&colour.rgb) {
                    palette.push(colour.rgb);
                }
            }
        };
        add(self.text, self.background, 12);
        add(self.faint_text, self.background, 6);
        add(self.grid, self.background, 1);
        add(self.wall, self.background, 3);
        add(self.obstacle, self.background, 4);
        add(self.obstacle_fill, self.background, 1);
        add(self.hidden, self.background, 4);
        add(self.estimated, self.background, 4);
        add(self.foliage, self.background, 2);
        add(self.lost, self.background, 4);
        add(self.high_ground, self.low_ground, 12);
        add(self.low_ground, self.background, 1);
        for colour in self.groups {
            add(colour, self.background, 7);
        }
        for colour in self.links {
            add(colour, self.background, 3);
            // Where links lie over each other.
            add(colour, colour.over(self.background), 1);
            add(colour.with_opacity(1.0), self.background, 1);
        }
        palette.truncate(255);
        palette
    }
}
