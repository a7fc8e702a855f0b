//! What expressions can compute with. Every function comes from `libm`.

/// A function of expressions.
#[derive(Clone, Copy, Debug)]
pub enum Function {
    /// Of one value.
    Unary(fn(f64) -> f64),
    /// Of two values.
    Binary(fn(f64, f64) -> f64),
}

/// Functions of expressions, by name.
pub const FUNCTIONS: &[(&str, Function)] = &[
    ("abs", Function::Unary(f64::abs)),
    ("acos", Function::Unary(libm::acos)),
    ("asin", Function::Unary(libm::asin)),
    ("atan", Function::Unary(libm::atan)),
    ("atan2", Function::Binary(libm::atan2)),
    ("ceil", Function::Unary(f64::ceil)),
    ("cos", Function::Unary(libm::cos)),
    ("exp", Function::Unary(libm::exp)),
    ("floor", Function::Unary(f64::floor)),
    ("hypot", Function::Binary(libm::hypot)),
    ("ln", Function::Unary(libm::log)),
    ("log10", Function::Unary(libm::log10)),
    ("log2", Function::Unary(libm::log2)),
    ("max", Function::Binary(f64::max)),
    ("min", Function::Binary(f64::min)),
    ("sign", Function::Unary(|x| if x == 0.0 { 0.0 } else { f64::signum(x) })),
    ("sin", Function::Unary(libm::sin)),
    ("sqrt", Function::Unary(f64::sqrt)),
    ("step", Function::Unary(|x| if 0.0 <= x { 1.0 } else { 0.0 })),
    ("tan", Function::Unary(libm::tan)),
    ("tanh", Function::Unary(libm::tanh)),
];

/// Constants of expressions.
pub(super) const CONSTANTS: &[(&str, f64)] = &[("pi", std::f64::consts::PI)];

/// Whether a name has a meaning already.
pub(super) fn is_taken(name: &str) -> bool {
    CONSTANTS.iter().any(|(taken, _)| *taken == name)
        || FUNCTIONS.iter().any(|(taken, _)| *taken == name)
}

/// What an operator between two values computes.
pub(super) type Binary = fn(f64, f64) -> f64;

/// Operators of sums, by their mark.
pub(super) const SUMS: &[(char, Binary)] = &[('+', |a, b| a + b), ('-', |a, b| a - b)];

/// Operators of products, by their mark.
pub(super) const PRODUCTS: &[(char, Binary)] = &[('*', |a, b| a * b), ('/', |a, b| a / b)];

/// The operator of powers.
pub(super) const POWERS: &[(char, Binary)] = &[('^', libm::pow)];

/// Comparisons of two numbers. One that begins with another stands before it.
pub(super) const COMPARISONS: &[(&str, Binary)] = &[
    ("<=", |a, b| truth(a, b, a <= b)),
    (">=", |a, b| truth(a, b, a >= b)),
    ("==", |a, b| truth(a, b, a == b)),
    ("!=", |a, b| truth(a, b, a != b)),
    ("<", |a, b| truth(a, b, a < b)),
    (">", |a, b| truth(a, b, a > b)),
];

/// 1 where a comparison holds, 0 where it does not, not a number where a side is not one.
fn truth(a: f64, b: f64, holds: bool) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { f64::from(u8::from(holds)) }
}

/// `and` of conditions. What is unknown matters only where the other side does not decide.
pub(super) fn and(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 { 0.0 } else { a * b }
}

/// `or` of conditions. What is unknown matters only where the other side does not decide.
pub(super) fn or(a: f64, b: f64) -> f64 {
    if a == 1.0 || b == 1.0 { 1.0 } else { a + b }
}

/// `not` of a condition.
pub(super) fn not(a: f64) -> f64 {
    1.0 - a
}

/// The sign `-`.
pub(super) fn negative(a: f64) -> f64 {
    -a
}
