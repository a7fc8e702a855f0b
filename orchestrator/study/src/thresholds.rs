//! Every statistical constant that decides an answer: its value, its meaning, and the reason for it.
//!
//! | group | what it decides |
//! |---|---|
//! | intervals | how wide intervals are, and when a profile gives them |
//! | held-out rows | which rows are left out together, and how many blocks a test needs |
//! | clusters | which rows a score test takes for dependent |
//! | random effects | over which lengths and times levels may vary |
//! | likelihood | which deviations the model of an outcome allows for |
//! | identifiability | what counts as collinear, and which data suffice for a parameter |
//! | permutation tests | how residuals of links are exchanged |
//! | curves and formulas | how flexible a curve is, and when a longer formula is preferred |
//! | screening | which candidates are fitted in full |
//! | measured motion | what is believed of tracks of robots and nodes |
//! | defects | which measurements count as defective |
//! | packets | which effects and parts of an error measured packets show |
//! | acceptance | which effects a diagnosis accepts |
//! | ties | which of several effects it names |
//! | contradictions | which effects the measurements refute |
//! | score tests | which rows a test of a candidate takes for dependent |
//! | limited effects | whether an effect is limited to some rows |
//! | structure | what is reported of residuals and errors |
//! | two campaigns (`two_campaigns`) | what changed between them |
//! | planning | which effects a campaign would show, and which campaign is next |
//!
//! Iteration limits, step sizes, grids and other numeric tolerances are where they are used. They change how fast and how
//! accurately a number is computed. Where a constant is a compromise without a source, its comment says "chosen" and names
//! what a larger and a smaller value would cost. A test lists the constants that other files may declare.

mod two_campaigns;

pub use two_campaigns::*;

// Intervals.

/// Probability beyond each end of a 90 % interval.
pub const TAIL_90: f64 = 0.05;
/// With more rows than this, an interval follows from the curvature of the log likelihood, a parabola by then: a profile takes many fits.
pub const MOST_PROFILED_ROWS: usize = 50_000;
/// Groups of links that the jackknife of a correlation length leaves out in turn. Chosen: more give more degrees of freedom, and take time.
pub const JACKKNIFE_GROUPS: usize = 24;
/// Fewest of these groups that give a length. Chosen: with fewer, a standard error has less than three degrees of freedom, and
/// an interval is too wide to be of use.
pub const FEWEST_JACKKNIFE_GROUPS: f64 = 4.0;

// Held-out rows: blocks and folds.

/// Number of folds of cross-validation. The usual choice: each fit has four fifths of the rows.
pub const N_FOLDS: usize = 5;
/// Fewest blocks for a test on held-out rows. The standard error is clustered over blocks, and with fewer its estimate is too uncertain.
pub const FEWEST_BLOCKS: usize = 20;
/// Fewest replicates in place of these blocks: flights, places, passes of an antenna. Chosen: of fewer, hardly any t is beyond chance.
pub const FEWEST_REPLICATES: usize = 4;
/// Fewest rows of a pass of an antenna through all bearings: two in each quadrant.
pub const FEWEST_PASS_ROWS: usize = 8;
/// Squares in which a node turns on the spot (m). Chosen: the level hardly changes within, and a robot that turns slips by less.
pub const SPOT_M: f64 = 0.5;
/// Blocks of time into which rows of links are cut: three times [`FEWEST_BLOCKS`]. Chosen: more blocks depend on each other more.
pub const TIME_BLOCKS: usize = 60;
/// Blocks of time into which the tracks of robots are cut, of at most and at least these lengths: as many as [`TIME_BLOCKS`].
pub const WANTED_BLOCKS: f64 = 60.0;
/// Length of the shortest block of a track, in windows. Chosen: neighbouring blocks depend on each other more if they are shorter.
pub const SHORTEST_BLOCK_WINDOWS: f64 = 2.0;
/// Length of the longest block of a track, in windows. Chosen: longer ones are fewer, and hardly more independent.
pub const LONGEST_BLOCK_WINDOWS: f64 = 20.0;
/// Squares along the longer side of the area in which robots move. Chosen: smaller squares are more blocks, and depend on each other.
pub const PLACES_ACROSS: f64 = 9.0;
/// Blocks of places of moving nodes from which no smaller squares are tried: twice [`FEWEST_BLOCKS`]. Chosen: as [`PLACES_ACROSS`].
pub const FEWEST_PLACE_BLOCKS: usize = 40;
/// Length of the windows over which robots are predicted by default (s). Chosen: a shorter one shows more noise, a longer one hides times.
pub const WINDOW_S: f64 = 1.0;
/// Lengths of the windows over which predictions are compared (s).
pub const HORIZONS_S: [f64; 4] = [0.1, 0.3, 1.0, 3.0];
/// Time before a window that an effect may remember (s). Rows that are fitted and rows that are scored are apart by this time
/// beside the window itself.
pub const MEMORY_S: f64 = 0.5;
/// Rows of one pair of nodes that follow each other and stay together when a search takes only some of the rows. Chosen:
/// enough to show a correlation in time.
pub const THINNED_RUN_ROWS: u64 = 8;
/// Rows of links that a search looks at; of several frames each, a third. The final fit uses all rows. Chosen: the time of a
/// search grows with the rows, and the smallest effect that it finds shrinks with their root.
pub const MOST_SEARCHED_ROWS: usize = 20_000;
/// Windows of robots that a search looks at. Chosen: a search then takes about half a minute of processor time.
pub const MOST_SEARCHED_WINDOWS: usize = 5000;
/// The same of robots that keep their velocity, in steps from sample to sample: each window is simulated by itself.
pub const MOST_SEARCHED_STEPS: f64 = 16_000.0;
/// Time before a block of windows from which on its robots are followed, in windows. Chosen: what actuators did before has no influence.
pub const SUBSET_LEAD_WINDOWS: f64 = 3.0;

// Clusters of score tests.

/// Length of the shortest blocks of time of links, as a share of the campaign: a quarter of one of [`TIME_BLOCKS`].
pub const SHORTEST_CLUSTER_SHARE: f64 = 1.0 / 240.0;
/// Length of the shortest blocks of time of robots, in windows. Noise of positions makes neighbouring windows err in opposite
/// directions, which only increases the estimated variance of sums.
pub const SHORTEST_CLUSTER_WINDOWS: f64 = 1.0;
/// Squares along the longer side of the plane, in each of which a node that moves counts as another node. Chosen: as [`PLACES_ACROSS`].
pub const NODE_SQUARES_ACROSS: f64 = 8.0;
/// Fewest blocks for a t test of a mean over blocks of rows. Chosen: with fewer, its p-value depends more on sums over blocks being normal.
pub const FEWEST_SUMMED_BLOCKS: usize = 8;

// Random effects.

/// Decorrelation lengths of shadowing that are tried (m): correlations fall as e^(-distance / length). Each is about three
/// times the one before.
pub const DECORRELATION_M: [f64; 4] = [0.5, 1.5, 4.0, 10.0];
/// Decorrelation length (m) of the random effects of links while no candidate asks for another, and if no node moves: one of
/// [`DECORRELATION_M`].
pub const DEFAULT_DECORRELATION_M: f64 = 1.5;
/// Correlation times of drifting levels that are tried (s). Each is about three times the one before.
pub const DRIFT_TIMES_S: [f64; 4] = [30.0, 100.0, 300.0, 1000.0];
/// Fewest independent levels of a drift within a campaign. With fewer, a drift is hardly distinguishable from a constant.
pub const FEWEST_DRIFT_LEVELS: f64 = 5.0;
/// Most independent levels of a drift within a campaign. With more, a level has few rows, and fits take longer.
pub const MOST_DRIFT_LEVELS: f64 = 400.0;
/// Time over which the level of all links counts as constant, as a share of its correlation time. Within it, the correlation is
/// at least e^(-1/4).
pub const COMMON_SPAN: f64 = 0.25;
/// The same at least, as a share of the campaign: it limits the number of these levels to 300.
pub const LEAST_COMMON_SPAN: f64 = 1.0 / 300.0;
/// Rows of a link of which each two are compared for a correlation: a limit of time, which grows with the square.
pub const MOST_COMPARED_ROWS: usize = 150;
/// Fewest pairs of rows in a bin of lags, for a correlation length. Chosen: a mean of fewer products is mostly noise.
pub const FEWEST_LAG_PAIRS: f64 = 10.0;
/// A correlation length lies between the shortest lag divided by this and the longest lag times this. Beyond, it is not
/// identifiable: all correlations are near 0, or near 1.
pub const CORRELATION_REACH: f64 = 4.0;
/// Probability of reception above which a reading counts as unselected. Of frames that are received less often, the stronger ones were.
pub const CERTAIN_PASS: f64 = 0.9;
/// Probability of reception from which residuals of losses are computed. Below, the ratio of received and expected frames is mostly noise.
pub const LEAST_EXPECTED_PASS: f64 = 0.3;

// Likelihood.

/// Share of frames that are received, or lost, against the reception curve. No stated probability counts as more certain
/// either. Without it a single frame could decide an answer.
pub const STRAY_FRAMES: f64 = 1e-3;
/// Correlation ρ of the frames of one row, because disturbances last longer than a frame. The effective sample size of k frames
/// is k / (1 + (k − 1) ρ), at most 100.
pub const FRAME_CORRELATION: f64 = 0.01;
/// It matters whether lost frames were logged if more than this share of readings is of a level at which more than this share of
/// frames is lost. Chosen: that moves a mean by less than readings are rounded.
pub const SELECTED_SHARE: f64 = 0.01;
/// Least standard deviation of the mean of any number of readings (dB): registers read in steps, and drift. Rounding to 1 dB
/// alone has 0.29 dB.
pub const MEAN_READING_SD_DB: f64 = 0.3;
/// Width of the range of powers that a reading stands for if readings are not rounded (dB), and the difference up to which
/// two such readings are equal.
pub const UNROUNDED_STEP_DB: f64 = 0.01;
/// The standard deviation of the noise over the root mean square of received readings about the mean level, at most. The
/// module `links/noise_bound.rs` derives it.
pub const NOISE_BOUND_RATIO: f64 = 1.1906;
/// Standard errors by which the noise may exceed that bound. A normal estimate exceeds three in one case of 740.
pub const NOISE_BOUND_ERRORS: f64 = 3.0;
/// Share of windows of robots that are wrong for reasons of their own, as the density of errors assumes: contaminated normal.
pub const BROAD_SHARE: f64 = 0.01;
/// Standard deviation of their errors over that of the others.
pub const BROAD_FACTOR: f64 = 10.0;
/// Standard deviation of the normal prior of the values of a curve at its knots, in units of a share of the way, or m/s. It
/// holds values near 0 that the data do not determine.
pub const CURVE_PRIOR_SD: f64 = 1.0;

// Identifiability.

/// Correlation of two estimates beyond which parameters of links are nearly collinear. Chosen: the standard error is then four
/// times that with the other parameter known.
pub const LINKS_COLLINEAR: f64 = 0.97;
/// The same for parameters of robots. The standard error is then three times that with the other parameter known.
pub const ROBOTS_COLLINEAR: f64 = 0.95;
/// Fewest places from which a node of unknown heading was seen, for an antenna pattern. A heading and a pattern are three
/// numbers; with fewer places, nothing is left to test them.
pub const FEWEST_VIEWS: usize = 6;
/// Positions of other agents, over all moments, above which shadowing by other agents is not considered: a limit of memory and time.
pub const MOST_AGENT_POSITIONS: usize = 8_000_000;

// Permutation tests of residuals of links.

/// Number of random permutations. The least p-value is 0.001.
pub const PERMUTATIONS: u64 = 999;
/// Fewest rows of a link in one direction, for its mean residual.
pub const FEWEST_DIRECTION_ROWS: f64 = 3.0;
/// Fewest links whose directions are compared.
pub const FEWEST_COMPARED_LINKS: usize = 10;
/// Spans of time within a campaign, in which residuals of one channel are compared.
pub const CHANNEL_SPANS: f64 = 48.0;
/// Spans of time within a campaign, over which residuals of links are compared.
pub const COURSE_SPANS: usize = 120;
/// Links are moved against each other alone, or, if there are more, in this number of groups: a limit of time.
pub const MOST_COURSES: usize = 200;

// Curves and formulas.

/// Knots of a curve over a covariate. Chosen: more knots follow more structure, and need more rows.
pub const CURVE_KNOTS: usize = 7;
/// Knots of a fine curve over time, for what comes and goes. Rows are left out in [`TIME_BLOCKS`], so that a fit has rows near every knot.
pub const FINE_CURVE_KNOTS: usize = 25;
/// Fewest rows, or windows, for each knot of a fine curve. Chosen: with fewer, values at knots are mostly noise.
pub const ROWS_PER_KNOT: usize = 40;
/// Fewest known values of a covariate, for a formula. Chosen: with fewer, the best of many formulas is the best by chance.
pub const FEWEST_FORMULA_ROWS: usize = 200;
/// Rows at which an expression is evaluated to see whether it varies.
pub const FORMULA_SAMPLE_ROWS: usize = 500;
/// A longer formula must reduce the root mean squared error below this share of that of a shorter one. Chosen: nearer to 1,
/// formulas are longer than the data support.
pub const LONGER_FORMULA: f64 = 0.998;
/// A formula of two covariates must reduce it below this share. Stricter, because many such formulas are tried.
pub const PRODUCT_FORMULA: f64 = 0.99;
/// Most cycles of a wave over the range of a covariate, in quarters. Chosen: with more cycles, some wave fits noise.
pub const MOST_WAVE_QUARTERS: u32 = 48;
/// A formula along a second direction must explain at least this share of the squares that the first leaves, and must reduce
/// the root mean squared error by this share.
pub const SECOND_DIRECTION_SHARE: f64 = 0.01;

// Screening.

/// Gain by which an obstacle that came and went must exceed one that always stood (nats). It is the best of many spans of time and places.
pub const LIMITED_OBSTACLE_NATS: f64 = 20.0;
/// A start of a robot effect is abandoned if a step gains less (nats).
pub const SCREEN_QUIET_NATS: f64 = 0.5;
/// A start that gains more in its last step (nats) has not converged, and its effect is fitted in full.
pub const SCREEN_CLIMBING_NATS: f64 = 1.0;

// Measured motion.

/// A node that stays within this distance (m) stands still. Chosen: above the rounding of positions, below a move that matters.
pub const STILL_M: f64 = 0.05;
/// A window begins no earlier after its track than this share of a window, so that the velocity is known by then.
pub const TRACK_BEGIN_WINDOWS: f64 = 0.5;
/// A window begins no earlier than at this sample of its track.
pub const TRACK_BEGIN_SAMPLES: usize = 3;
/// Time at the beginning of a track from which the velocity there is estimated (s).
pub const TRACK_BEGIN_S: f64 = 0.5;
/// Fewest campaigns that all begin at one place, for positions to count as relative to where a robot began. So many are no coincidence.
pub const FEWEST_RUNS_ALIKE: usize = 5;
/// Length of the segments that another robot simulator predicts (s). Chosen: place and heading of its prediction are less
/// accurate in a longer one, and a shorter one takes more predictions.
pub const FOREIGN_SEGMENT_S: f64 = 1.0;
/// Time by which a prediction begins before its segment (s): five time constants of actuators of 0.4 s.
pub const FOREIGN_LEAD_S: f64 = 2.0;

/// A thrust is odd if its median is so many times the weight of a robot, or that part of it. Chosen: loads and climbs change it by less.
pub const WEIGHTS_OF_THRUST: f64 = 3.0;
/// An axis has the opposite sign if commanded and measured accelerations along it have at least this correlation, negative …
pub const OPPOSITE_CORRELATION: f64 = 0.3;
/// … by at least this number of its standard errors. Chosen: neighbouring accelerations share a sample, and controllers react to noise.
pub const OPPOSITE_ERRORS: f64 = 6.0;

// Defects of the measurement.

/// Probability with which any defect is reported of measurements without one.
pub const DEFECT_FAMILY_ERROR: f64 = 0.005;
/// A defect matters from this share of the squared error of the readings, or of the rows.
pub const DEFECT_WORTH_SHARE: f64 = 0.01;

/// The place of a node may be wrong if another explains this share of the variance between its links, beside its level.
pub const NODE_PLACE_SHARE: f64 = 0.5;
/// Between two rows of a node that are so near (m), its place is known, for a clock that runs fast or slow.
pub const MOST_CLOCK_GAP_M: f64 = 10.0;
/// The mean of measured headings is off by chance by at most this number of its standard deviations.
pub const CHANCE_SDS: f64 = 3.0;
/// Shifts of channel labels that are tried: up to this number of channels up and down.
pub const MOST_CHANNEL_SHIFT: i16 = 3;

/// Difference of the time stamps of one frame within which they coincide (s).
pub const COINCIDENCE_S: f64 = 0.02;
/// Greatest shift of a clock that coincidences of frames show (s).
pub const MOST_FRAME_SHIFT_S: f64 = 30.0;
/// At least this share of a receiver's rows coincides with those of other receivers at the shift.
pub const LEAST_COINCIDENT_SHARE: f64 = 0.5;
/// At most this share of them coincides without the shift.
pub const MOST_COINCIDENT_AS_IS: f64 = 0.1;
/// A shift is ambiguous if another has this share of its coincidences: frames are periodic.
pub const AMBIGUOUS_SHIFT_SHARE: f64 = 0.7;
/// Fewest rows of a receiver for a shift by coincidences.
pub const FEWEST_COINCIDENT_ROWS: usize = 20;
/// Greatest shift of a clock that positions along tracks show (s).
pub const MOST_TRACK_SHIFT_S: f64 = 10.0;
/// A smaller shift (s) is a latency rather than a defect.
pub const LEAST_CLOCK_SHIFT_S: f64 = 0.1;
/// Least share of a receiver's rows whose positions can be interpolated, for a shift by tracks.
pub const LEAST_TRACKED_SHARE: f64 = 0.5;
/// Fewest such rows.
pub const FEWEST_TRACKED_ROWS: usize = 40;
/// Between two rows that are further apart in time (s), a position is known only if the node has not moved by [`STILL_M`].
pub const MOST_TRACK_GAP_S: f64 = 1.5;

/// Least and greatest probability with which two frames have the same outcome by chance.
pub const EQUAL_OUTCOME_CHANCES: (f64, f64) = (0.001, 0.999);
/// Fewest pairs of consecutive rows of one link, for that probability.
pub const FEWEST_CONSECUTIVE_PAIRS: usize = 50;

/// Slower nodes have no direction of motion (m/s): noise of positions would decide it.
pub const LEAST_HEADING_MPS: f64 = 0.1;
/// Headings agree with the motion from this mean cosine of their difference.
pub const HEADING_AGREES: f64 = 0.7;
/// Fewest moments of motion, for a convention of headings.
pub const FEWEST_HEADING_MOMENTS: usize = 50;
/// Bonferroni factor of the conventions of headings: conventions times ways to test them.
pub const HEADING_TESTS: f64 = 5.0;

/// Fewest readings for a search of outliers.
pub const FEWEST_OUTLIER_READINGS: usize = 200;
/// Fewest outliers.
pub const FEWEST_OUTLIERS: usize = 5;
/// Greatest share of readings that are outliers. More are a property of the channel.
pub const MOST_OUTLIER_SHARE: f64 = 0.1;
/// Least share of the outliers that lie above the prediction. Physical effects mostly attenuate, so that deviations on one
/// side are no defect.
pub const LEAST_OUTLIERS_ABOVE: f64 = 0.15;
/// Fewest outliers above the prediction.
pub const FEWEST_OUTLIERS_ABOVE: usize = 3;
/// Greatest share of outliers among the rows beside outliers. A physical effect lasts, and gives more.
pub const MOST_OUTLIERS_BESIDE: f64 = 0.2;

/// Fewest readings of moving nodes, for noise of positions.
pub const FEWEST_MOVING_READINGS: usize = 200;
/// Fewest pairs of receivers on opposite sides, for their covariance to count.
pub const FEWEST_OPPOSITE_PAIRS: usize = 200;
/// Fewest other rows of a frame, from which its level is estimated.
pub const FEWEST_OTHER_RECEIVERS: usize = 2;
/// Greatest cosine between the directions of receivers on opposite sides of a sender.
pub const OPPOSITE_COSINE: f64 = -0.3;

/// Of the readings in the last two steps of a register without a limit, the greatest share in the last step: half where their
/// density is constant, and a margin.
pub const SMOOTH_END_SHARE: f64 = 0.65;
/// Fewest directed links with a reading at the limit of a register.
pub const FEWEST_LIMITED_LINKS: usize = 4;

/// Fewest readings of a receiver that reports one reading.
pub const FEWEST_STUCK_READINGS: usize = 20;
/// Fewest senders of such a receiver.
pub const FEWEST_STUCK_SENDERS: usize = 2;
/// Greatest variance of its readings, as a share of the variance of their predictions.
pub const MOST_STUCK_VARIANCE: f64 = 0.05;
/// Least standard deviation of these predictions (dB).
pub const LEAST_PREDICTED_SD_DB: f64 = 1.5;

/// Fewest rows of a part of the measurements whose ends may be exchanged.
pub const FEWEST_SWAPPED_ROWS: usize = 20;
/// Fewest moments of several senders and one receiver, for exchanged ends.
pub const FEWEST_REVERSED_MOMENTS: usize = 10;
/// Greatest number of moments of one sender and several receivers, for each of those.
pub const MOST_REGULAR_MOMENTS: f64 = 0.1;

// Networks compared with measured packets.

/// Level of significance of the gain of an added effect, and of a part of the error, by simulated null distributions.
pub const PACKETS_LEVEL: f64 = 0.01;
/// Fewest seeds for that level: the least p-value of a test by n seeds is 1 / (n + 1).
pub const FEWEST_PACKETS_SEEDS: u64 = 99;
/// Level of significance below which measured packets are inconsistent with the model.
pub const CONSISTENCY_LEVEL: f64 = 0.05;
/// Fewest seeds for that level.
pub const FEWEST_CONSISTENCY_SEEDS: usize = 19;
/// Fewest seeds for a fit of an effect. Chosen: with fewer, the scatter of the figures is not known well enough.
pub const FEWEST_FIT_SEEDS: u64 = 24;
/// Greatest number of effects that a search adds. Chosen: each takes a search over all others by simulation.
pub const MOST_ADDED_EFFECTS: usize = 3;
/// Greatest distance from the best candidate at which a candidate is refined: in nats, and as a share of the gain of the best
/// one. The first gains are interpolated linearly between distant values, and so are not more accurate than this.
pub const REFINED_BEHIND: (f64, f64) = (20.0, 0.5);
/// Greatest number of candidates that are refined, the best ones: a limit of time.
pub const MOST_REFINED: usize = 4;
/// Greatest distance from the best candidate at which one is chosen (nats), if only it makes the packets consistent.
pub const CONSISTENT_BEHIND_NATS: f64 = 10.0;
/// A rival is indistinguishable from the best candidate if it makes the packets at most twenty times less probable (nats).
pub const RIVAL_NATS: f64 = 3.0;
/// Fall of the log likelihood within which values of a parameter are searched further (nats): wider than any interval that is reported.
pub const SEARCHED_NATS: f64 = 4.0;
/// How often seeds are drawn again, for the error that their choice causes.
pub const SEED_RESAMPLES: u64 = 100;
/// Degrees of freedom of Student's density of the figures of a run. Chosen: normal densities make a run five standard
/// deviations away all but impossible.
pub const FIGURES_FREEDOM: f64 = 8.0;
/// Least standard deviation of the logarithm of a time or a number.
pub const LEAST_RATIO_SD: f64 = 0.01;
/// Least weight of no correlation in the shrinkage estimate of correlations between figures. With it, their matrix is invertible
/// even if one figure follows from others.
pub const LEAST_SHRINKAGE: f64 = 0.02;
/// Fewest packets of a mote whose delivery counts as that of the worst mote.
pub const FEWEST_MOTE_PACKETS: u32 = 5;

/// Campaigns of link measurements that the model simulates, to see what their noise does to the figures.
pub const SPLIT_CAMPAIGNS: u64 = 39;
/// Runs over each of them.
pub const SPLIT_RUNS: u64 = 5;
/// Frames of a link that are counted together, on average. Chosen: fewer determine a reception ratio less, more mix what changes.
pub const COUNTED_FRAMES: f64 = 20.0;
/// Least difference of a figure on its scale that counts, and least standard deviation of a figure for the parts of an error.
pub const LEAST_FIGURE_DIFFERENCE: f64 = 0.005;

// Acceptance of an effect.

/// Probability with which any of all candidates together is accepted wrongly (Holm's correction). Chosen: smaller, only larger
/// effects are found.
pub const FAMILY_ERROR: f64 = 0.005;
/// An effect is worth adding from this gain on held-out rows (nats per row) …
pub const WORTH_NATS: f64 = 0.01;
/// … or if it removes this share of the squared error of the present model.
pub const WORTH_SHARE: f64 = 0.01;
/// In any case it removes this share of the squared error of the model as configured.
pub const LEAST_ERROR_SHARE: f64 = 0.001;
/// Level of significance without correction, used where another test has shown already that something is missing: whether an
/// effect, a limit or structure is there beside what rows that depend on each other share.
pub const UNCORRECTED_LEVEL: f64 = 0.05;
/// Greatest number of effects that the selection accepts: a limit of time, since each takes a search over all others.
pub const MOST_ACCEPTED: usize = 8;
/// Random effects that raise the log likelihood by this (nats) are evident if they predict held-out rows no worse.
pub const EVIDENT_NATS: f64 = 50.0;
/// A random effect is far from 0 at this number of halves of its 90 % interval: 3.3 standard errors.
pub const FAR_HALF_INTERVALS: f64 = 2.0;
/// Fewest blocks within a span of time, for the scatter of gains there.
pub const FEWEST_BLOCKS_WITHIN: usize = 8;

// Ties between effects.

/// A physical effect is preferred over random effects, and a constant over other effects, if it gains at least this share of what they
/// gain. Chosen: nearer to 1, random effects hide effects whose shape is not exact; smaller, wrong effects replace them.
pub const PREFERRED_SHARE: f64 = 0.85;
/// Structure may be of a known effect if one gains at least this share of what a free curve gains. Chosen: a law of few numbers that is
/// right gains more than a curve with many; one that is nearly right loses little.
pub const CATALOGUE_SHARE: f64 = 0.8;
/// Structure over one covariate may be of another over which there is at least this share of it. Chosen: covariates that go together share
/// structure.
pub const RIVAL_STRUCTURE: f64 = 0.5;
/// What varies less than this within runs, as a share of its variation, has one value for each run. Chosen: of a straight line over ten runs
/// without pauses between them, this share is within runs.
pub const WITHIN_RUNS: f64 = 0.01;
/// The effect nearest to a curve is not worth a mention below this share of its gain.
pub const NEAREST_SHARE: f64 = 0.5;
/// A rival of the chosen candidate raises the log likelihood by at least this share of what it does.
pub const RIVAL_SHARE: f64 = 0.8;
/// Two candidates are tied if their gains differ by at most this number of standard errors of the difference: about 95 % of a
/// normal distribution.
pub const TIED_ERRORS: f64 = 2.0;
/// Two candidates are tied, too, if the likelihood of all rows left out is at most e^3 = 20 times as great under one as under the
/// other. Where both predict nearly the same, the standard error of the difference is too small to count.
pub const TIED_NATS: f64 = 3.0;
/// Two effects are tied, too, if what they move, beside all that was estimated, is correlated by at least this: then errors of
/// covariates decide between them. Chosen: of one part in fifty of the information.
pub const SAME_COLUMNS: f64 = 0.99;
/// An effect has several nearest rivals if each further one explains at least this share of what those before leave. Chosen: each
/// further rival halves the rest.
pub const RIVAL_ADDS_SHARE: f64 = 0.5;
/// The nearest rivals are at most so many. Chosen: a search accepts hardly more in place of one effect.
pub const MOST_RIVALS_IN_A_SET: usize = 3;
/// An effect is tied with levels of nodes if less than this share of its information is left beside them.
pub const LEFT_BESIDE_NODES: f64 = 0.1;
/// A spread is identified if half of the 90 % interval of its logarithm is at most this: 0.6 to 1.65 times the estimate. Another size is
/// identified if half of its 90 % interval is at most this share of its distance from no effect: 3.3 standard errors.
pub const IDENTIFIED_HALF: f64 = 0.5;
/// Level of the likelihood-ratio test by which a curve replaces an effect nested in it. Rows count as independent, which they
/// are not, so that the level is far below any other.
pub const NESTED_LEVEL: f64 = 1e-6;
/// Gain by which a candidate must exceed its own special case to count as better (nats). With three additional parameters that
/// much occurs by chance in one case of 140.
pub const SPECIAL_CASE_NATS: f64 = 6.0;

// Screening of candidates.

/// A term that raises the log likelihood of all rows by less (nats) cannot be significant on held-out rows. A log likelihood
/// ratio with mean m has a variance of about 2 m, so that it lies √(m/2) standard errors above 0; a single candidate needs
/// 2.58. The gain on held-out rows is smaller than on the rows of the fit.
pub const HOPELESS_NATS: f64 = 12.0;

// Contradictions: measurements show what an effect rules out, or another channel gets worse.

/// Level of significance of a contradiction. Chosen: an effect is accepted at [`FAMILY_ERROR`], and rarely refused by chance.
pub const CONTRADICTED_LEVEL: f64 = 0.001;
/// Motion passes a bound from this number of times the bound. Chosen: another effect that is missing changes motion by less.
pub const BOUND_MARGIN: f64 = 1.1;
/// Motion may pass a bound in this share of the windows: noise beyond three standard deviations, and stray windows, of which
/// each end may be one (twice [`BROAD_SHARE`]).
pub const PASSING_SHARE: f64 = 0.05;
/// An effect makes another measured channel worse if the mean squared error there rises significantly ([`FAMILY_ERROR`]) and by
/// this share. Chosen: noise is filtered otherwise with each effect, which changes the error by a few percent.
pub const WORSE_SHARE: f64 = 0.05;

// Lack of fit.

/// A group of rows scatters more than the others if its variance exceeds theirs by this factor (lower bound). Chosen: less is worth little.
pub const NOISIER_RATIO: f64 = 1.1;
/// Spans of a campaign between which the scatter of a group is taken as independent.
pub const NOISE_BLOCKS: f64 = 20.0;
/// A model lacks something if what it leaves exceeds the variance of noise by this factor (clustered lower bound of 95 %).
pub const LACK_OF_FIT_RATIO: f64 = 1.5;
/// A window of a robot is repeated so many windows later: neighbours share the error of a position. Chosen: later, what the
/// model gets wrong may have changed. A row of a link is repeated within so many of the shortest blocks of time.
pub const REPEAT_WINDOWS: [f64; 2] = [2.0, 4.0];
/// See [`REPEAT_WINDOWS`].
pub const MOST_REPEAT_BLOCKS: f64 = 2.0;
/// The greatest errors of robots that do not count as lack of fit, as a share of the windows: twice [`BROAD_SHARE`].
pub const FREE_SHARE: f64 = 0.02;

// Score tests.

/// Fewest clusters of rows for a test.
pub const FEWEST_CLUSTERS: usize = 20;
/// Fewest nodes for a test over links.
pub const FEWEST_NODES: usize = 6;
/// Correlation that sums of neighbouring blocks may have, or twice the standard error of no correlation. It increases the
/// variance of their sum.
pub const NEIGHBOUR_CORRELATION: f64 = 0.2;
/// Greatest share of the information of a test in one cluster. Beyond, that cluster decides alone, and there is no test.
pub const MOST_IN_ONE_CLUSTER: f64 = 0.5;
/// A cluster counts that has at least this share of the mean information of all.
pub const COUNTED_INFORMATION: f64 = 1e-3;
/// Probability of intervals, and of a bound on what may be hidden.
pub const INTERVAL_PROBABILITY: f64 = 0.9;
/// Probability with which an effect of the size that is called detectable is found.
pub const DETECTABLE_PROBABILITY: f64 = 0.9;

// Limited effects: to a group of rows, or to a span of time.

/// Least rise of the log likelihood that a limited effect promises (nats).
pub const LIMITED_NATS: f64 = 8.0;
/// Rise by which a limit in time must exceed none (nats): its end is one of many.
pub const TIME_LIMIT_NATS: f64 = 6.0;
/// Groups and spans of time that are tested, the most promising ones: a limit of time.
pub const TESTED_LIMITS: usize = 3;
/// Groups from which one must stand out from the others.
pub const FEWEST_COMPARED_GROUPS: usize = 6;
/// Of so many groups one may be like the one that stands out from the others. Chosen: of fewer, either may be the exception.
pub const FEWEST_OTHERS_PER_GROUP: usize = 3;
/// Limited effects that compete at most.
pub const MOST_LIMITED: usize = 4;
/// Limited effects of one kind at most.
pub const MOST_LIMITED_OF_A_KIND: usize = 4;
/// A limited effect competes if it promises at least this share of what the best one does.
pub const LIMITED_SHARE: f64 = 0.5;

// Structure in residuals, and errors by covariate.

/// Bins of a covariate in which residuals are tested for structure.
pub const STRUCTURE_BINS: usize = 10;
/// The same where nothing is found, for a covariate that comes and goes.
pub const FINE_STRUCTURE_BINS: usize = 30;
/// Fewest rows for each of these bins, on average. Chosen: the standard error of the mean of so many rows is less than
/// a quarter of their standard deviation.
pub const FEWEST_STRUCTURE_BIN_ROWS: usize = 20;
/// Random flips of the signs of whole blocks.
pub const SIGN_FLIPS: u64 = 200;
/// Resamples of blocks for intervals of errors (bootstrap).
pub const BOOTSTRAP_RESAMPLES: u64 = 400;
/// Bins of a covariate by which errors are shown.
pub const ERROR_BINS: usize = 8;
/// Fewest rows for each of these bins, on average. Chosen: the standard error of the mean of so many rows is a third
/// of their standard deviation.
pub const FEWEST_ERROR_BIN_ROWS: usize = 10;
/// Share of the greatest errors of a group that are left out of its error, as outliers.
pub const TRIMMED_SHARE: f64 = 0.05;
/// Fewest groups whose errors are compared.
pub const FEWEST_ERROR_GROUPS: usize = 5;
/// Errors of a group are reported if they are significantly more than this number of times those of the others.
pub const GROUP_ERROR_RATIO: f64 = 2.0;
/// A smaller constant offset of readings is not reported in a sentence (dB).
pub const LEAST_OFFSET_DB: f64 = 1.0;
/// A constant offset is the same everywhere if it explains at least this share of the squared plain error.
pub const EVERYWHERE_SHARE: f64 = 0.5;
/// The plain error is reported if the root mean squared error of the configured model differs from it by more than this share.
pub const PLAIN_ERROR_SHARE: f64 = 0.1;

// A simulator of robots other than our own.

/// A simulator executes an effect if, with it, its predictions miss at most this share of what the fit moves: effects are fitted
/// to first order.
pub const MOST_MISSING_SHARE: f64 = 0.5;

// Planning: power, and the next campaign.

/// Probability with which an effect of the reported size is found: the usual choice.
pub const POWER: f64 = 0.8;
/// Campaigns that are simulated for a first estimate of that size.
pub const FIRST_CAMPAIGNS: u64 = 3;
/// First estimates at most.
pub const MOST_FIRST_ESTIMATES: usize = 8;
/// Sizes at which detections are counted, relative to the first estimate.
pub const POWER_SIZES: [f64; 4] = [0.7, 0.9, 1.1, 1.4];
/// Bins of a covariate among which the conditions of the next campaign are chosen.
pub const CONDITION_BINS: usize = 10;
/// Fewest rows of a bin.
pub const FEWEST_BIN_ROWS: usize = 20;
/// A parameter is not determined well if its interval is longer than this number of times its value.
pub const WIDE_INTERVAL: f64 = 1.0;
/// Least difference between two predictions, in their unit, for a condition of the next campaign. A smaller share of received
/// frames is printed as 0.00.
pub const LEAST_NEXT_DIFFERENCE: f64 = 0.005;
/// A condition of the next campaign that needs more rows than this number of times those at hand is not recommended.
pub const MOST_NEXT_ROWS: f64 = 10.0;
/// Two covariates go together if their correlation is at least this (absolute): four fifths of their variance are common.
pub const GOING_TOGETHER: f64 = 0.9;
/// A covariate hardly varies if its standard deviation is at most this share of its mean.
pub const HARDLY_VARYING_SHARE: f64 = 0.1;
