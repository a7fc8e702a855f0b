//! Expressions that users write: `-a * log10_distance + b * max(temperature_c - 25, 0)`.
//!
//! An expression is numbers, names, `+ - * / ^`, parentheses and the functions of [`FUNCTIONS`]. It can do nothing but
//! compute: no loops, no assignments, no access to anything but the values handed to it, at most [`MOST_BYTES`] long and
//! [`MOST_DEEP`] deep. It is read here, so that what is wrong is pointed at, and translated once into a program with
//! functions from `libm`, so that every processor computes the same.
//!
//! A condition ([`Formula::condition`]) compares such expressions by `< <= > >= == !=`, joined by `and`, `or`, `not`. It is 1
//! where it holds, 0 where it does not, and not a number where a missing value decides.
//!
//! `-x^2` is −(x²), `2^3^2` is 2⁹, `a - b - c` is (a − b) − c.

mod operators;
mod program;
mod reader;
mod written;

use program::Program;
use reader::Want;
use std::fmt;

pub use operators::{FUNCTIONS, Function};
pub use written::{Bound, Keys, MOST_NAMES, Written};

/// Longest expression (bytes).
pub const MOST_BYTES: usize = 1000;
/// Most parentheses, functions and signs within each other.
pub const MOST_DEEP: usize = 40;

/// An expression, ready to be evaluated.
#[derive(Clone, Debug)]
pub struct Formula {
    text: String,
    names: Vec<String>,
    program: Program,
}

impl Formula {
    /// Reads an expression.
    ///
    /// * `known`: names it may use.
    /// * `accepts`: which further names it may use. Of these, none may look like a known one that was mistyped.
    ///
    /// # Errors
    ///
    /// What is wrong, and where.
    ///
    /// # Examples
    ///
    /// ```
    /// use proto::formula::Formula;
    ///
    /// let formula = Formula::parse("-2 * x^2 + min(x, y)", &["x", "y"], &|_| false).unwrap();
    /// assert_eq!(formula.names(), ["x", "y"]);
    /// assert_eq!(formula.evaluate(&[3.0, 1.0]), -17.0);
    ///
    /// let error = Formula::parse("2 * lenght", &["length"], &|_| false).unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "unknown name lenght; did you mean length?\n    2 * lenght\n        ^"
    /// );
    /// ```
    pub fn parse(
        text: &str,
        known: &[&str],
        accepts: &dyn Fn(&str) -> bool,
    ) -> Result<Self, FormulaError> {
        Self::parse_as(text, Want::Number, known, accepts)
    }

    /// Reads a condition over the names of `known`.
    ///
    /// # Errors
    ///
    /// What is wrong, and where.
    ///
    /// # Examples
    ///
    /// ```
    /// use proto::formula::Formula;
    ///
    /// let formula = Formula::condition("x > 2 and not y == 1", &["x", "y"]).unwrap();
    /// assert_eq!(formula.evaluate(&[3.0, 1.0]), 0.0);
    /// assert_eq!(formula.evaluate(&[3.0, 0.5]), 1.0);
    /// assert!(formula.evaluate(&[3.0, f64::NAN]).is_nan());
    /// assert_eq!(formula.evaluate(&[1.0, f64::NAN]), 0.0);
    /// ```
    pub fn condition(text: &str, known: &[&str]) -> Result<Self, FormulaError> {
        Self::condition_of(text, known, &|_| false)
    }

    /// As [`Formula::condition`], with further names: see [`Formula::parse`].
    ///
    /// # Errors
    ///
    /// What is wrong, and where.
    pub fn condition_of(
        text: &str,
        known: &[&str],
        accepts: &dyn Fn(&str) -> bool,
    ) -> Result<Self, FormulaError> {
        Self::parse_as(text, Want::Truth, known, accepts)
    }

    fn parse_as(
        text: &str,
        want: Want,
        known: &[&str],
        accepts: &dyn Fn(&str) -> bool,
    ) -> Result<Self, FormulaError> {
        let error =
            |at: usize, message: String| FormulaError { text: text.to_owned(), at, message };
        if MOST_BYTES < text.len() {
            return Err(error(
                MOST_BYTES,
                format!("the expression is longer than {MOST_BYTES} bytes"),
            ));
        }
        let read = reader::read(text, want, known, accepts)
            .map_err(|(at, message)| error(text[..at].chars().count(), message))?;
        Ok(Self { text: text.to_owned(), names: read.names, program: read.program })
    }

    /// As it was written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The names it uses, each once, in the order in which they first appear.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Its value, given those of [`Formula::names`] in their order. Not a number where it is not defined, or where the
    /// number of values is wrong.
    #[must_use]
    pub fn evaluate(&self, values: &[f64]) -> f64 {
        if values.len() == self.names.len() { self.program.evaluate(values) } else { f64::NAN }
    }
}

impl PartialEq for Formula {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text && self.names == other.names
    }
}

/// What is wrong with an expression. Shown with the expression, a caret under the place.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct FormulaError {
    /// The expression.
    pub text: String,
    /// Where in it: so many characters from its begin.
    pub at: usize,
    /// What is wrong.
    pub message: String,
}

impl fmt::Display for FormulaError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // One line, so that the caret stands below its place.
        let line: String =
            self.text.chars().map(|c| if c.is_whitespace() { ' ' } else { c }).collect();
        write!(f, "{}\n    {line}\n    {:>width$}", self.message, '^', width = self.at + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const KNOWN: &[&str] = &["distance_m", "log10_distance", "x", "y", "temperature_c"];

    fn value(text: &str, values: &[f64]) -> f64 {
        Formula::parse(text, KNOWN, &|_| false).unwrap().evaluate(values)
    }

    fn refusal(text: &str) -> String {
        Formula::parse(text, KNOWN, &|_| false).unwrap_err().to_string()
    }

    #[test]
    fn it_computes_as_mathematics_does() {
        for (text, expected) in [
            ("1 + 2 * 3", 7.0),
            ("(1 + 2) * 3", 9.0),
            ("8 - 4 - 2", 2.0),
            ("16 / 4 / 2", 2.0),
            ("16 / 4 * 2", 8.0),
            ("2 * 3 / 4 * 2", 3.0),
            ("-3^2", -9.0),
            ("2^3^2", 512.0),
            ("2^-1", 0.5),
            ("2 / -2^2", -0.5),
            ("2*-3", -6.0),
            ("--3", 3.0),
            ("+3 - -3", 6.0),
            ("1e3 + 2.5E-1 + .5", 1000.75),
            ("max(min(1, 2), min(3, 4))", 3.0),
            ("min(1, max(2, -pi)) + 1", 2.0),
            ("step(-1) + 10 * step(0) + 100 * step(2)", 110.0),
            ("sqrt(16) + abs(-2) + floor(2.9) + ceil(2.1) + sign(-7)", 10.0),
            ("log10(1000) + ln(exp(2)) + log2(8)", 8.0),
            ("cos(pi) + sin(pi / 2) + tan(0)", 0.0),
            ("4 * atan2(1, 1) - pi + atan(0) + asin(0) + acos(1) + tanh(0)", 0.0),
            ("hypot(3, 4)", 5.0),
        ] {
            let got = value(text, &[]);
            assert!((got - expected).abs() < 1e-12, "{text}: {got}");
        }
    }

    #[test]
    fn a_condition_holds_or_not_or_is_unknown() {
        let (x, y) = (2.0, f64::NAN);
        for (text, expected) in [
            ("x > 1", 1.0),
            ("x >= 2 and x <= 2", 1.0),
            ("x < 2 or x == 3", 0.0),
            ("not x < 2 and x != 3", 1.0),
            ("not (x < 2 and x != 3)", 1.0),
            ("(x + 1) * 2 > 5", 1.0),
            ("((x > 1))", 1.0),
            ("x > 3 or x > 1 and x < 3", 1.0),
            ("-x < -1 and abs(-x) > 1", 1.0),
            ("x < 1 and y > 0", 0.0),
            ("x > 1 or y > 0", 1.0),
            ("x > 1 and y > 0", f64::NAN),
            ("not y > 0", f64::NAN),
        ] {
            let formula = Formula::condition(text, KNOWN).unwrap();
            let values: Vec<f64> =
                formula.names().iter().map(|name| if name == "x" { x } else { y }).collect();
            let got = formula.evaluate(&values);
            assert!(got == expected || got.is_nan() && expected.is_nan(), "{text}: {got}");
        }
    }

    #[test]
    fn what_is_no_condition_is_refused_at_its_place() {
        for (text, at, part) in [
            ("x", 1, "compare it with another"),
            ("x = 3", 2, "use == for equality"),
            ("x > 1 & y > 2", 6, "use and"),
            ("x > 1 | y > 2", 6, "use or"),
            ("!(x > 1)", 0, "use not"),
            ("1 < x < 3", 6, "join two comparisons with and"),
            ("x and y > 1", 2, "one side is a number"),
            ("(x > 1) + 2 > 1", 0, "expected a number, got a condition"),
            ("not x", 4, "expected a condition after not"),
            ("x > ", 4, "expected a number, a name or ( at the end"),
            ("> x", 0, "expected a number, a name or ( before >"),
            ("temperature_f > 2", 0, "did you mean temperature_c?"),
        ] {
            let error = Formula::condition(text, KNOWN).unwrap_err();
            assert!(error.message.contains(part) && error.at == at, "{text}: {error:?}");
        }
        // Conditions are no numbers: formulas have none.
        assert!(refusal("x > 1").starts_with("unexpected >"));
    }

    #[test]
    fn names_are_in_the_order_in_which_they_appear() {
        let formula =
            Formula::parse("y * (x - humidity_pct) / y", KNOWN, &|name| name == "humidity_pct")
                .unwrap();
        assert_eq!(formula.names(), ["y", "x", "humidity_pct"]);
        assert_eq!(formula.evaluate(&[2.0, 5.0, 3.0]), 2.0);
        assert!(formula.evaluate(&[2.0]).is_nan(), "too few values");
    }

    #[test]
    fn many_names_keep_their_values_apart() {
        let names: Vec<String> = (0..120).map(|i| format!("column_{i}")).collect();
        let text: Vec<String> =
            names[..60].iter().enumerate().map(|(i, name)| format!("{name}*{i}")).collect();
        let formula = Formula::parse(&text.join("+"), &[], &|_| true).unwrap();
        let values: Vec<f64> = (0..60).map(f64::from).collect();
        assert_eq!(formula.evaluate(&values), (0..60).map(|i| f64::from(i * i)).sum::<f64>());
    }

    #[test]
    fn an_expression_may_hold_many_values_back() {
        // Every operand is held until what follows it is known.
        let deepest = MOST_DEEP - 1;
        let text = format!("{}x{}", "x+(".repeat(deepest), ")".repeat(deepest));
        assert_eq!(value(&text, &[3.0]), 3.0 * MOST_DEEP as f64);
        let text = format!("{}y{}", "max(x,y*2^min(x,".repeat(13), "))".repeat(13));
        assert_eq!(value(&text, &[1.0, 5.0]), 10.0);
    }

    #[test]
    fn errors_point_at_their_place() {
        for (text, expected) in [
            ("", "is empty\n    \n    ^"),
            ("x +", "expected a number, a name or ( at the end\n    x +\n       ^"),
            ("x + * y", "expected a number, a name or ( before *\n    x + * y\n        ^"),
            ("(x + y", "( is not closed\n    (x + y\n    ^"),
            ("x + y)", "unexpected )\n    x + y)\n         ^"),
            ("x y", "expected an operator before y\n    x y\n      ^"),
            ("2 x", "expected an operator before x\n    2 x\n      ^"),
            ("x & y", "unexpected &\n    x & y\n      ^"),
            ("α + x", "unexpected α\n    α + x\n    ^"),
            ("1.2.3", "not a number: 1.2.3\n    1.2.3\n    ^"),
            ("1e999", "not a number: 1e999\n    1e999\n    ^"),
            (
                "distanc_m * 2",
                "unknown name distanc_m; did you mean distance_m?\n    distanc_m * 2\n    ^",
            ),
            ("2 * sqr(x)", "unknown function sqr; did you mean sqrt?\n    2 * sqr(x)\n        ^"),
            ("sqrt x", "sqrt is a function; expected ( after it\n    sqrt x\n    ^"),
            ("min(x)", "min takes 2 values\n    min(x)\n    ^"),
            ("sin(x, y)", "sin takes 1 value\n    sin(x, y)\n    ^"),
            ("x = 3", "unexpected =\n    x = 3\n      ^"),
            ("x; y", "unexpected ;\n    x; y\n     ^"),
        ] {
            assert_eq!(refusal(text), expected, "{text}");
        }
        let deep = format!("{}x{}", "(".repeat(100), ")".repeat(100));
        assert!(refusal(&deep).starts_with("nested deeper than 40"));
        assert!(refusal(&"x+".repeat(600)).starts_with("the expression is longer than 1000 bytes"));
    }

    #[test]
    fn a_further_name_that_looks_like_a_known_one_is_taken_for_a_slip() {
        let error = Formula::parse("temperatur_c", KNOWN, &|_| true).unwrap_err();
        assert!(error.message.contains("did you mean temperature_c?"), "{error}");
        assert!(Formula::parse("humidity_pct", KNOWN, &|_| true).is_ok());
    }

    #[test]
    fn what_is_not_defined_is_not_a_number() {
        assert!(value("sqrt(x)", &[-1.0]).is_nan());
        assert!(value("log10(0 * x) * 0", &[1.0]).is_nan());
        assert_eq!(value("1 / x", &[0.0]), f64::INFINITY);
    }

    /// Expressions over `x0`, `x1`, `x2`.
    fn expressions() -> impl Strategy<Value = String> {
        let operator = prop::sample::select(vec!["+", "-", "*", "/", "^"]);
        let function = prop::sample::select(FUNCTIONS.to_vec());
        (0..3).prop_map(|i| format!("x{i}")).prop_recursive(6, 40, 2, move |inner| {
            prop_oneof![
                (inner.clone(), operator.clone(), inner.clone())
                    .prop_map(|(left, operator, right)| format!("{left} {operator} {right}")),
                inner.clone().prop_map(|inner| format!("-({inner})")),
                (function.clone(), inner.clone(), inner).prop_map(
                    |((name, function), first, second)| match function {
                        Function::Unary(_) => format!("{name}({first})"),
                        Function::Binary(_) => format!("{name}({first}, {second})"),
                    }
                ),
            ]
        })
    }

    proptest! {
        /// Numbers are computed with while an expression is read, values of names when it is evaluated.
        #[test]
        fn a_number_and_a_name_of_that_value_give_the_same_bits(
            text in expressions(),
            values in prop::array::uniform3(-20.0..20.0f64),
        ) {
            let names = ["x0", "x1", "x2"];
            let formula = Formula::parse(&text, &names, &|_| false);
            prop_assume!(formula.is_ok(), "too deep or too long");
            let formula = formula.unwrap();
            let with_numbers = names.iter().zip(values).fold(text, |text, (name, value)| {
                text.replace(name, &format!("({value})"))
            });
            let constant = Formula::parse(&with_numbers, &[], &|_| false);
            prop_assume!(constant.is_ok(), "too deep or too long");
            let place = |name: &String| names.iter().position(|known| known == name).unwrap();
            let used: Vec<f64> = formula.names().iter().map(|name| values[place(name)]).collect();
            let (a, b) = (formula.evaluate(&used), constant.unwrap().evaluate(&[]));
            prop_assert!(a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan(), "{a} {b}");
        }

        #[test]
        fn no_text_makes_it_panic(text in "[ -~α]{0,40}") {
            let _ = Formula::parse(&text, KNOWN, &|_| true);
        }

        #[test]
        fn no_expression_makes_it_panic(
            tokens in prop::collection::vec(
                prop::sample::select(vec![
                    "x", "y", "1", "2.5", "1e-3", "+", "-", "*", "/", "^", "(", ")", ",", "min(", "sqrt(", "pi",
                ]),
                0..30,
            ),
        ) {
            if let Ok(formula) = Formula::parse(&tokens.concat(), KNOWN, &|_| true) {
                let values = vec![1.5; formula.names().len()];
                let _ = formula.evaluate(&values);
            }
        }

        /// Against Rust's own arithmetic, precedence and all.
        #[test]
        fn sums_of_products_are_what_rust_makes_of_them(a in -9.0..9.0f64, b in 0.1..9.0f64, c in -9.0..9.0f64) {
            let formula = Formula::parse("a - b * c / b ^ 2 - -c * a", &["a", "b", "c"], &|_| false).unwrap();
            let expected = a - b * c / (b * b) - -c * a;
            prop_assert!((formula.evaluate(&[a, b, c]) - expected).abs() <= 1e-12 * (1.0 + expected.abs()));
        }
    }
}
