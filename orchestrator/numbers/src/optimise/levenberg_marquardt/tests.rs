use super::*;

/// Half the negative sum of squared residuals, with bounds on the parameters.
struct LeastSquares<R> {
    /// Residuals and their derivatives by each parameter.
    residuals: R,
    bounds: Vec<(f64, f64)>,
    n_equations: usize,
}

type Rows = (Vec<f64>, Vec<Vec<f64>>);

struct Fit {
    params: Vec<f64>,
    rows: Rows,
}

impl<R: Fn(&[f64]) -> Rows> LeastSquares<R> {
    fn new(n: usize, residuals: R) -> Self {
        let bounds = vec![(f64::NEG_INFINITY, f64::INFINITY); n];
        Self { residuals, bounds, n_equations: 0 }
    }

    fn at(&self, params: &[f64]) -> Fit {
        Fit { params: params.to_vec(), rows: (self.residuals)(params) }
    }

    fn fitted(&mut self, search: LevenbergMarquardt, start: &[f64]) -> Solution<Fit, DVector<f64>> {
        let start = self.at(start);
        search.maximise(self, start)
    }
}

impl<R: Fn(&[f64]) -> Rows> Objective for LeastSquares<R> {
    type Point = Fit;
    type Equations = (DMatrix<f64>, DVector<f64>);
    type Step = DVector<f64>;

    fn value(&self, point: &Fit) -> f64 {
        -0.5 * point.rows.0.iter().map(|residual| residual * residual).sum::<f64>()
    }

    fn equations(&mut self, point: &Fit) -> Option<Self::Equations> {
        self.n_equations += 1;
        let (residuals, derivatives) = &point.rows;
        let n = point.params.len();
        let jacobian = DMatrix::from_fn(residuals.len(), n, |i, j| derivatives[i][j]);
        let residuals = DVector::from_row_slice(residuals);
        Some((jacobian.transpose() * &jacobian, -jacobian.transpose() * residuals))
    }

    fn step(
        &mut self,
        point: &Fit,
        (information, gradient): &Self::Equations,
        damping: f64,
    ) -> Option<Self::Step> {
        let matrix = damped(information, damping, 0.0);
        bounded_step(&matrix, gradient, &point.params, |i| self.bounds[i])
    }

    fn predicted_gain(&self, (_, gradient): &Self::Equations, step: &Self::Step) -> f64 {
        0.5 * step.dot(gradient)
    }

    fn advance(&mut self, point: &Fit, step: &Self::Step) -> Result<Fit, f64> {
        let moved = point.params.iter().zip(step.iter()).zip(&self.bounds);
        let params: Vec<f64> =
            moved.map(|((x, step), (min, max))| (x + step).clamp(*min, *max)).collect();
        let next = self.at(&params);
        let change = self.value(&next) - self.value(point);
        if 0.0 <= change { Ok(next) } else { Err(change) }
    }
}

fn search() -> LevenbergMarquardt {
    LevenbergMarquardt {
        min_damping: 1e-12,
        increase: 8.0,
        singular: (10.0, 1e-6),
        max_iterations: 1000,
        max_trials: 40,
        min_predicted_gain: 1e-28,
        ..LevenbergMarquardt::default()
    }
}

fn rosenbrock(x: &[f64]) -> Rows {
    let residuals = vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]];
    (residuals, vec![vec![-20.0 * x[0], 10.0], vec![-1.0, 0.0]])
}

#[test]
fn a_quadratic_takes_one_step_without_damping() {
    let mut problem = LeastSquares::new(2, |x: &[f64]| {
        (vec![x[0] + x[1] - 3.0, x[0] - 2.0 * x[1]], vec![vec![1.0, 1.0], vec![1.0, -2.0]])
    });
    let one = LevenbergMarquardt { damping: 0.0, max_iterations: 1, ..search() };
    let found = problem.fitted(one, &[50.0, -7.0]);
    assert!((found.point.params[0] - 2.0).abs() < 1e-12, "{:?}", found.point.params);
    assert!((found.point.params[1] - 1.0).abs() < 1e-12, "{:?}", found.point.params);
    assert_eq!((found.termination, problem.n_equations), (Termination::Limit, 1));
    assert!((found.gain - 0.5 * (40.0 * 40.0 + 64.0 * 64.0)).abs() < 1e-9, "{}", found.gain);
}

#[test]
fn rosenbrocks_valley_is_followed_to_its_end() {
    let mut problem = LeastSquares::new(2, rosenbrock);
    let found = problem.fitted(search(), &[-1.2, 1.0]);
    assert_eq!(found.termination, Termination::Converged);
    assert!(found.point.params.iter().all(|x| (x - 1.0).abs() < 1e-9), "{:?}", found.point.params);
    assert!(problem.n_equations < 40, "{}", problem.n_equations);
}

/// M. Powell, Computer Journal 5 (1962): the information matrix is singular at the optimum, where all parameters are 0.
#[test]
fn powells_singular_function_converges_although_its_matrix_does_not_stay_definite() {
    let (five, ten) = (5.0_f64.sqrt(), 10.0_f64.sqrt());
    let mut problem = LeastSquares::new(4, move |x: &[f64]| {
        let (b, d) = (x[1] - 2.0 * x[2], x[0] - x[3]);
        let residuals = vec![x[0] + 10.0 * x[1], five * (x[2] - x[3]), b * b, ten * d * d];
        let derivatives = vec![
            vec![1.0, 10.0, 0.0, 0.0],
            vec![0.0, 0.0, five, -five],
            vec![0.0, 2.0 * b, -4.0 * b, 0.0],
            vec![2.0 * ten * d, 0.0, 0.0, -2.0 * ten * d],
        ];
        (residuals, derivatives)
    });
    let found = problem.fitted(search(), &[3.0, -1.0, 0.0, 1.0]);
    assert_eq!(found.termination, Termination::Converged);
    assert!(found.point.params.iter().all(|x| x.abs() < 1e-5), "{:?}", found.point.params);
}

#[test]
fn an_optimum_at_a_bound_is_found_for_all_other_parameters() {
    let mut problem = LeastSquares::new(2, rosenbrock);
    problem.bounds[0] = (-2.0, 0.5);
    let found = problem.fitted(search(), &[-1.2, 1.0]);
    assert_eq!(found.termination, Termination::Converged);
    assert_eq!(found.point.params[0], 0.5);
    assert!((found.point.params[1] - 0.25).abs() < 1e-9, "{:?}", found.point.params);
}

#[test]
fn a_parameter_at_its_bound_does_not_hold_the_others_back() {
    let bounds = |_| (0.0, 1.0);
    // Nearly a ridge: alone the first would go far up, and the second as far down.
    let information = DMatrix::from_row_slice(2, 2, &[1.0, 0.99, 0.99, 1.0]);
    let gradient = DVector::from_row_slice(&[1.0, 0.9]);
    let free = bounded_step(&information, &gradient, &[0.5, 0.5], bounds).unwrap();
    assert!((information.clone() * free - &gradient).amax() < 1e-12);
    // The first stays, and the second goes to its optimum beside it.
    let step = bounded_step(&information, &gradient, &[1.0, 0.05], bounds).unwrap();
    assert!(step[0].abs() < 1e-12 && (step[1] - 0.9).abs() < 1e-12, "{step}");
    // At both bounds nothing moves.
    let step = bounded_step(&information, &gradient, &[1.0, 1.0], bounds).unwrap();
    assert!(step.amax() < 1e-12, "{step}");
}

#[test]
fn a_search_says_why_it_ended() {
    let mut problem = LeastSquares::new(2, rosenbrock);
    let short = LevenbergMarquardt { max_iterations: 3, ..search() };
    let found = problem.fitted(short, &[-1.2, 1.0]);
    assert_eq!((found.termination, problem.n_equations), (Termination::Limit, 3));
    // Derivatives of the wrong sign lead downhill, however short the step.
    let mut wrong = LeastSquares::new(1, |x: &[f64]| (vec![x[0] - 1.0], vec![vec![-1.0]]));
    let few = LevenbergMarquardt { max_trials: 5, ..search() };
    let found = wrong.fitted(few, &[3.0]);
    assert_eq!((found.termination, found.gain), (Termination::Stalled, 0.0));
    assert_eq!(found.point.params, [3.0]);
    assert!(0.0 < found.step.unwrap()[0], "the first step that was tried");
    // A parameter that changes nothing leaves a singular matrix at any damping.
    let mut flat = LeastSquares::new(1, |_: &[f64]| (vec![1.0], vec![vec![0.0]]));
    let found = flat.fitted(few, &[3.0]);
    assert_eq!((found.termination, found.step), (Termination::Stalled, None));
}

/// A nonlinear regression of the Statistical Reference Datasets of the National Institute of Standards and Technology,
/// https://www.itl.nist.gov/div898/strd/nls/nls_main.shtml, from its second start.
fn regression(
    [y, x]: [&[f64]; 2],
    model: fn(&[f64], f64) -> (f64, Vec<f64>),
    start: &[f64],
    certified: (&[f64], f64),
) {
    let mut problem = LeastSquares::new(start.len(), |params: &[f64]| {
        let rows = y.iter().zip(x).map(|(y, x)| {
            let (predicted, derivatives) = model(params, *x);
            (predicted - y, derivatives)
        });
        rows.unzip()
    });
    let found = problem.fitted(search(), start);
    for (param, expected) in found.point.params.iter().zip(certified.0) {
        assert!((param / expected - 1.0).abs() < 1e-7, "{param} is not {expected}");
    }
    let squares = -2.0 * problem.value(&found.point);
    assert!((squares / certified.1 - 1.0).abs() < 1e-9, "{squares}");
}

#[test]
fn misra1a_has_its_certified_parameters() {
    let y = [
        10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47,
        81.78,
    ];
    let x = [
        77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1,
        760.0,
    ];
    let model = |b: &[f64], x: f64| {
        let fall = libm::exp(-b[1] * x);
        (b[0] * (1.0 - fall), vec![1.0 - fall, b[0] * x * fall])
    };
    let certified = [2.389_421_291_8e2, 5.501_564_318_1e-4];
    regression([&y, &x], model, &[250.0, 0.0005], (&certified, 1.245_513_889_4e-1));
}

#[test]
fn mgh09_has_its_certified_parameters() {
    let y = [0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246];
    let x = [4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625];
    let model = |b: &[f64], x: f64| {
        let (above, below) = (x * x + x * b[1], x * x + x * b[2] + b[3]);
        let value = b[0] * above / below;
        (value, vec![above / below, b[0] * x / below, -value * x / below, -value / below])
    };
    let certified =
        [1.928_069_345_8e-1, 1.912_823_287_3e-1, 1.230_565_069_3e-1, 1.360_623_306_8e-1];
    regression([&y, &x], model, &[0.25, 0.39, 0.415, 0.39], (&certified, 3.075_056_038_5e-4));
}

#[test]
fn thurber_has_its_certified_parameters() {
    let y = [
        80.574, 84.248, 87.264, 87.195, 89.076, 89.608, 89.868, 90.101, 92.405, 95.854, 100.696,
        101.060, 401.672, 390.724, 567.534, 635.316, 733.054, 759.087, 894.206, 990.785, 1090.109,
        1080.914, 1122.643, 1178.351, 1260.531, 1273.514, 1288.339, 1327.543, 1353.863, 1414.509,
        1425.208, 1421.384, 1442.962, 1464.350, 1468.705, 1447.894, 1457.628,
    ];
    let x = [
        -3.067, -2.981, -2.921, -2.912, -2.840, -2.797, -2.702, -2.699, -2.633, -2.481, -2.363,
        -2.322, -1.501, -1.460, -1.274, -1.212, -1.100, -1.046, -0.915, -0.714, -0.566, -0.545,
        -0.400, -0.309, -0.109, -0.103, 0.010, 0.119, 0.377, 0.790, 0.963, 1.006, 1.115, 1.572,
        1.841, 2.047, 2.200,
    ];
    let model = |b: &[f64], x: f64| {
        let above = b[0] + x * (b[1] + x * (b[2] + x * b[3]));
        let below = 1.0 + x * (b[4] + x * (b[5] + x * b[6]));
        let value = above / below;
        let powers = [1.0, x, x * x, x * x * x];
        let by_above = powers.map(|power| power / below);
        let by_below = powers[1..].iter().map(|power| -value * power / below);
        (value, by_above.into_iter().chain(by_below).collect())
    };
    let certified = [
        1.288_139_68e3,
        1.491_079_253_5e3,
        5.832_383_687_7e2,
        7.541_664_429_1e1,
        9.662_950_286_4e-1,
        3.979_728_579_7e-1,
        4.972_729_734_9e-2,
    ];
    let start = [1300.0, 1500.0, 500.0, 75.0, 1.0, 0.4, 0.05];
    regression([&y, &x], model, &start, (&certified, 5.642_708_239_7e3));
}
