//! Reads an expression, says where it is wrong, and writes it with all parentheses, as the compiler wants it.

use super::MOST_DEEP;
use super::operators::{CONSTANTS, FUNCTIONS};
use std::fmt::Write as _;

/// An expression that was read.
pub(super) struct Read {
    /// With parentheses around every operation, and `v000`, `v001`, … in place of names.
    pub(super) expression: String,
    /// The names.
    pub(super) names: Vec<String>,
}

/// What is wrong, and at which byte.
type Problem = (usize, String);

/// Reads an expression.
pub(super) fn read(
    text: &str,
    known: &[&str],
    accepts: &dyn Fn(&str) -> bool,
) -> Result<Read, Problem> {
    let tokens = tokens(text)?;
    if tokens.is_empty() {
        return Err((0, "is empty".to_owned()));
    }
    let mut reader = Reader {
        tokens: &tokens,
        next: 0,
        end: text.len(),
        depth: 0,
        names: Vec::new(),
        known,
        accepts,
    };
    let expression = reader.sum()?;
    match reader.peek() {
        None => Ok(Read { expression, names: reader.names }),
        Some(Token { kind: Kind::Mark(_), text, at }) => Err((*at, format!("unexpected {text}"))),
        Some(token) => Err((token.at, format!("an operator is missing before {}", token.text))),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Number(f64),
    Name,
    Mark(char),
}

#[derive(Clone, Copy, Debug)]
struct Token<'a> {
    kind: Kind,
    text: &'a str,
    at: usize,
}

/// The words of an expression.
fn tokens(text: &str) -> Result<Vec<Token<'_>>, Problem> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let while_in =
            |holds: &dyn Fn(char) -> bool| rest.find(|c: char| !holds(c)).unwrap_or(rest.len());
        let (kind, length) = match first {
            _ if first.is_whitespace() => {
                at += first.len_utf8();
                continue;
            }
            '0'..='9' | '.' => {
                let mut length = while_in(&|c| c.is_ascii_alphanumeric() || c == '.');
                // The sign of an exponent.
                let is_power = rest[..length].ends_with(['e', 'E']);
                if is_power && rest[length..].starts_with(['+', '-']) {
                    let digits = &rest[length + 1..];
                    let n = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
                    length += 1 + n;
                }
                match rest[..length].parse::<f64>() {
                    Ok(number) if number.is_finite() => (Kind::Number(number), length),
                    _ => return Err((at, format!("not a number: {}", &rest[..length]))),
                }
            }
            'a'..='z' | 'A'..='Z' | '_' => {
                (Kind::Name, while_in(&|c| c.is_ascii_alphanumeric() || c == '_'))
            }
            '+' | '-' | '*' | '/' | '^' | '(' | ')' | ',' => (Kind::Mark(first), 1),
            _ => return Err((at, format!("unexpected {first}"))),
        };
        tokens.push(Token { kind, text: &rest[..length], at });
        at += length;
    }
    Ok(tokens)
}

struct Reader<'a> {
    tokens: &'a [Token<'a>],
    next: usize,
    /// Length of the expression.
    end: usize,
    depth: usize,
    names: Vec<String>,
    known: &'a [&'a str],
    accepts: &'a dyn Fn(&str) -> bool,
}

impl<'a> Reader<'a> {
    fn peek(&self) -> Option<&'a Token<'a>> {
        self.tokens.get(self.next)
    }

    /// Takes one of these marks, if it is next.
    fn take(&mut self, marks: &[char]) -> Option<char> {
        match self.peek()?.kind {
            Kind::Mark(mark) if marks.contains(&mark) => {
                self.next += 1;
                Some(mark)
            }
            _ => None,
        }
    }

    /// One level deeper.
    fn nested<T>(
        &mut self,
        read: impl FnOnce(&mut Self) -> Result<T, Problem>,
    ) -> Result<T, Problem> {
        self.depth += 1;
        if MOST_DEEP < self.depth {
            let at = self.peek().map_or(self.end, |token| token.at);
            return Err((at, format!("nested deeper than {MOST_DEEP}")));
        }
        let result = read(self);
        self.depth -= 1;
        result
    }

    fn sum(&mut self) -> Result<String, Problem> {
        let mut left = self.product()?;
        while let Some(mark) = self.take(&['+', '-']) {
            left = format!("({left}{mark}{})", self.product()?);
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<String, Problem> {
        let mut left = self.signed()?;
        while let Some(mark) = self.take(&['*', '/']) {
            left = format!("({left}{mark}{})", self.signed()?);
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<String, Problem> {
        match self.take(&['+', '-']) {
            Some('-') => Ok(format!("(neg({}))", self.nested(Self::signed)?)),
            Some(_) => self.nested(Self::signed),
            None => self.power(),
        }
    }

    fn power(&mut self) -> Result<String, Problem> {
        let base = self.primary()?;
        match self.take(&['^']) {
            Some(_) => Ok(format!("({base}^{})", self.nested(Self::signed)?)),
            None => Ok(base),
        }
    }

    fn primary(&mut self) -> Result<String, Problem> {
        let Some(token) = self.peek() else {
            return Err((self.end, "a number, a name or ( is missing at the end".to_owned()));
        };
        match token.kind {
            Kind::Number(number) => {
                self.next += 1;
                Ok(format!("{number}"))
            }
            Kind::Name => {
                self.next += 1;
                if self.take(&['(']).is_some() { self.call(token) } else { self.name(token) }
            }
            Kind::Mark('(') => {
                self.next += 1;
                let inner = self.nested(Self::sum)?;
                self.close(token)?;
                Ok(format!("({inner})"))
            }
            Kind::Mark(_) => {
                Err((token.at, format!("a number, a name or ( is missing before {}", token.text)))
            }
        }
    }

    /// The end of what `opened`.
    fn close(&mut self, opened: &Token<'_>) -> Result<(), Problem> {
        if self.take(&[')']).is_some() {
            return Ok(());
        }
        match self.peek() {
            None => Err((opened.at, format!("{} is not closed", opened.text))),
            Some(Token { kind: Kind::Mark(_), text, at }) => {
                Err((*at, format!("unexpected {text}")))
            }
            Some(token) => Err((token.at, format!("an operator is missing before {}", token.text))),
        }
    }

    fn call(&mut self, function: &Token<'_>) -> Result<String, Problem> {
        let name = function.text;
        let Some(&(_, n_values)) = FUNCTIONS.iter().find(|(known, _)| *known == name) else {
            let hint = hint(name, FUNCTIONS.iter().map(|(known, _)| *known));
            return Err((function.at, format!("unknown function {name}{hint}")));
        };
        let mut values = vec![self.nested(Self::sum)?];
        while self.take(&[',']).is_some() {
            values.push(self.nested(Self::sum)?);
        }
        self.close(function)?;
        match &values[..] {
            [value] if n_values == 1 => Ok(format!("({name}({value}))")),
            [first, second] if n_values == 2 => Ok(format!("(({first}){name}({second}))")),
            _ => {
                let s = if n_values == 1 { "" } else { "s" };
                Err((function.at, format!("{name} takes {n_values} value{s}")))
            }
        }
    }

    fn name(&mut self, token: &Token<'_>) -> Result<String, Problem> {
        let name = token.text;
        let place = match self.names.iter().position(|used| used == name) {
            Some(place) => place,
            None => {
                if !self.known.contains(&name) {
                    if let Some((_, constant)) = CONSTANTS.iter().find(|(known, _)| *known == name)
                    {
                        return Ok(format!("{constant}"));
                    }
                    if FUNCTIONS.iter().any(|(known, _)| *known == name) {
                        let message = format!("{name} is a function: ( is missing after it");
                        return Err((token.at, message));
                    }
                    let hint = hint(name, self.known.iter().copied());
                    if !(self.accepts)(name) || !hint.is_empty() {
                        return Err((token.at, format!("unknown name {name}{hint}")));
                    }
                }
                self.names.push(name.to_owned());
                self.names.len() - 1
            }
        };
        let mut variable = String::new();
        let _ = write!(variable, "v{place:03}");
        Ok(variable)
    }
}

/// `; did you mean …?` where a known name is near.
fn hint<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> String {
    let most = if name.len() < 6 { 1 } else { 2 };
    known
        .map(|known| (strsim::damerau_levenshtein(known, name), known))
        .filter(|&(distance, _)| distance <= most)
        .min()
        .map(|(_, known)| format!("; did you mean {known}?"))
        .unwrap_or_default()
}
