//! What expressions can compute with. Every function comes from `libm`.

use exmex::{BinOp, MakeOperators, MatchLiteral, Operator};

/// Functions of expressions, and how many values each takes.
pub const FUNCTIONS: &[(&str, usize)] = &[
    ("abs", 1),
    ("acos", 1),
    ("asin", 1),
    ("atan", 1),
    ("atan2", 2),
    ("ceil", 1),
    ("cos", 1),
    ("exp", 1),
    ("floor", 1),
    ("hypot", 2),
    ("ln", 1),
    ("log10", 1),
    ("log2", 1),
    ("max", 2),
    ("min", 2),
    ("sign", 1),
    ("sin", 1),
    ("sqrt", 1),
    ("step", 1),
    ("tan", 1),
    ("tanh", 1),
];

/// Constants of expressions.
pub(super) const CONSTANTS: &[(&str, f64)] = &[("pi", std::f64::consts::PI)];

/// Whether a name has a meaning already.
pub(super) fn is_taken(name: &str) -> bool {
    CONSTANTS.iter().any(|(taken, _)| *taken == name)
        || FUNCTIONS.iter().any(|(taken, _)| *taken == name)
}

/// The operators, for exmex. What it is given has parentheses around every operation, so their ranks do not matter.
#[derive(Clone, Debug)]
pub(super) struct Operators;

/// 1 where a comparison holds, 0 where it does not, not a number where a side is not one.
fn truth(a: f64, b: f64, holds: bool) -> f64 {
    if a.is_nan() || b.is_nan() { f64::NAN } else { f64::from(u8::from(holds)) }
}

fn two(name: &str, apply: fn(f64, f64) -> f64) -> Operator<'_, f64> {
    Operator::make_bin(name, BinOp { apply, prio: 0, is_commutative: false })
}

impl MakeOperators<f64> for Operators {
    fn make<'a>() -> Vec<Operator<'a, f64>> {
        vec![
            two("+", |a, b| a + b),
            two("-", |a, b| a - b),
            two("*", |a, b| a * b),
            two("/", |a, b| a / b),
            two("^", libm::pow),
            two("min", f64::min),
            two("max", f64::max),
            two("atan2", libm::atan2),
            two("hypot", libm::hypot),
            two("<", |a, b| truth(a, b, a < b)),
            two("<=", |a, b| truth(a, b, a <= b)),
            two("==", |a, b| truth(a, b, a == b)),
            two("!=", |a, b| truth(a, b, a != b)),
            // What is unknown matters only where the other side does not decide.
            two("&&", |a, b| if a == 0.0 || b == 0.0 { 0.0 } else { a * b }),
            two("||", |a, b| if a == 1.0 || b == 1.0 { 1.0 } else { a + b }),
            Operator::make_unary("not", |x| 1.0 - x),
            Operator::make_unary("abs", f64::abs),
            Operator::make_unary("acos", libm::acos),
            Operator::make_unary("asin", libm::asin),
            Operator::make_unary("atan", libm::atan),
            Operator::make_unary("ceil", f64::ceil),
            Operator::make_unary("cos", libm::cos),
            Operator::make_unary("exp", libm::exp),
            Operator::make_unary("floor", f64::floor),
            Operator::make_unary("ln", libm::log),
            Operator::make_unary("log10", libm::log10),
            Operator::make_unary("log2", libm::log2),
            Operator::make_unary("neg", |x| -x),
            Operator::make_unary("sign", |x| if x == 0.0 { 0.0 } else { f64::signum(x) }),
            Operator::make_unary("sin", libm::sin),
            Operator::make_unary("sqrt", f64::sqrt),
            Operator::make_unary("step", |x| if 0.0 <= x { 1.0 } else { 0.0 }),
            Operator::make_unary("tan", libm::tan),
            Operator::make_unary("tanh", libm::tanh),
        ]
    }
}

/// Numbers as exmex is given them: digits, a point, digits.
#[derive(Clone, Debug)]
pub(super) struct Numbers;

impl MatchLiteral for Numbers {
    fn is_literal(text: &str) -> Option<&str> {
        let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        (0 < end).then(|| &text[..end])
    }
}
