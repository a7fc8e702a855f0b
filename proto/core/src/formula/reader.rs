//! Reads an expression, says where it is wrong, and writes it with all parentheses, as the compiler wants it.

use super::MOST_DEEP;
use super::operators::{CONSTANTS, FUNCTIONS};
use std::fmt::Write as _;

/// What an expression must be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Want {
    /// A number.
    Number,
    /// True or false: a comparison, or several joined by `and`, `or`, `not`.
    Truth,
}

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
    want: Want,
    known: &[&str],
    accepts: &dyn Fn(&str) -> bool,
) -> Result<Read, Problem> {
    let tokens = tokens(text, want)?;
    if tokens.is_empty() {
        return Err((0, "is empty".to_owned()));
    }
    let mut reader = Reader {
        tokens: &tokens,
        next: 0,
        end: text.len(),
        depth: 0,
        names: Vec::new(),
        want,
        known,
        accepts,
    };
    let Piece { text: expression, is_truth, .. } = reader.whole()?;
    match reader.peek() {
        None if want == Want::Truth && !is_truth => Err((
            text.len(),
            "is a number, not a condition: compare it with another, by < <= > >= == or !="
                .to_owned(),
        )),
        None => Ok(Read { expression, names: reader.names }),
        Some(Token { kind: Kind::Mark(_) | Kind::Comparison, text, at }) => {
            Err((*at, format!("unexpected {text}")))
        }
        Some(token) => Err((token.at, format!("an operator is missing before {}", token.text))),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Number(f64),
    Name,
    Mark(char),
    Comparison,
}

/// A part of an expression, written with all parentheses.
struct Piece {
    text: String,
    is_truth: bool,
    /// Where it begins.
    at: usize,
}

#[derive(Clone, Copy, Debug)]
struct Token<'a> {
    kind: Kind,
    text: &'a str,
    at: usize,
}

/// The words of an expression.
fn tokens(text: &str, want: Want) -> Result<Vec<Token<'_>>, Problem> {
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
            '<' | '>' | '=' | '!' if want == Want::Truth => {
                let length = if rest[1..].starts_with('=') { 2 } else { 1 };
                match &rest[..length] {
                    "=" => return Err((at, "unexpected =: equality is ==".to_owned())),
                    "!" => {
                        return Err((at, "unexpected !: it is not, or != of numbers".to_owned()));
                    }
                    _ => (Kind::Comparison, length),
                }
            }
            '&' | '|' if want == Want::Truth => {
                let word = if first == '&' { "and" } else { "or" };
                return Err((at, format!("unexpected {first}: it is {word}")));
            }
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
    want: Want,
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

    /// Takes one of these words, if it is next, where conditions are read.
    fn take_word(&mut self, word: &str) -> Option<usize> {
        let token = self.peek()?;
        let is_it = self.want == Want::Truth && token.kind == Kind::Name && token.text == word;
        is_it.then(|| {
            self.next += 1;
            token.at
        })
    }

    /// Where the next token begins.
    fn at(&self) -> usize {
        self.peek().map_or(self.end, |token| token.at)
    }

    /// All that may stand between parentheses.
    fn whole(&mut self) -> Result<Piece, Problem> {
        let mut left = self.both()?;
        while let Some(at) = self.take_word("or") {
            left = joined(left, "||", self.both()?, at)?;
        }
        Ok(left)
    }

    fn both(&mut self) -> Result<Piece, Problem> {
        let mut left = self.inverted()?;
        while let Some(at) = self.take_word("and") {
            left = joined(left, "&&", self.inverted()?, at)?;
        }
        Ok(left)
    }

    fn inverted(&mut self) -> Result<Piece, Problem> {
        let Some(at) = self.take_word("not") else { return self.comparison() };
        let inner = self.nested(Self::inverted)?;
        if !inner.is_truth {
            return Err((inner.at, "a number stands where not needs a condition".to_owned()));
        }
        Ok(Piece { text: format!("(not({}))", inner.text), is_truth: true, at })
    }

    fn comparison(&mut self) -> Result<Piece, Problem> {
        let left = self.sum()?;
        let Some(Token { kind: Kind::Comparison, text, .. }) = self.peek() else {
            return Ok(left);
        };
        self.next += 1;
        let right = self.sum()?;
        let (at, a, b) = (left.at, number(left)?, number(right)?);
        if let Some(Token { kind: Kind::Comparison, text, at }) = self.peek() {
            let message = format!("unexpected {text}: join two comparisons by and");
            return Err((*at, message));
        }
        let text = match *text {
            ">" => format!("({b}<{a})"),
            ">=" => format!("({b}<={a})"),
            other => format!("({a}{other}{b})"),
        };
        Ok(Piece { text, is_truth: true, at })
    }

    fn sum(&mut self) -> Result<Piece, Problem> {
        let mut left = self.product()?;
        while let Some(mark) = self.take(&['+', '-']) {
            left = computed(left, mark, self.product()?)?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Piece, Problem> {
        let mut left = self.signed()?;
        while let Some(mark) = self.take(&['*', '/']) {
            left = computed(left, mark, self.signed()?)?;
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Piece, Problem> {
        let at = self.at();
        match self.take(&['+', '-']) {
            Some('-') => {
                let inner = number(self.nested(Self::signed)?)?;
                Ok(Piece { text: format!("(neg({inner}))"), is_truth: false, at })
            }
            Some(_) => {
                let text = number(self.nested(Self::signed)?)?;
                Ok(Piece { text, is_truth: false, at })
            }
            None => self.power(),
        }
    }

    fn power(&mut self) -> Result<Piece, Problem> {
        let base = self.primary()?;
        match self.take(&['^']) {
            Some(_) => computed(base, '^', self.nested(Self::signed)?),
            None => Ok(base),
        }
    }

    fn primary(&mut self) -> Result<Piece, Problem> {
        let Some(token) = self.peek() else {
            return Err((self.end, "a number, a name or ( is missing at the end".to_owned()));
        };
        let at = token.at;
        let value = |text: String| Piece { text, is_truth: false, at };
        match token.kind {
            Kind::Number(number) => {
                self.next += 1;
                Ok(value(format!("{number}")))
            }
            Kind::Name => {
                self.next += 1;
                let is_call = self.take(&['(']).is_some();
                Ok(value(if is_call { self.call(token)? } else { self.name(token)? }))
            }
            Kind::Mark('(') => {
                self.next += 1;
                let inner = self.nested(Self::whole)?;
                self.close(token)?;
                Ok(Piece { text: format!("({})", inner.text), is_truth: inner.is_truth, at })
            }
            Kind::Mark(_) | Kind::Comparison => {
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
            Some(Token { kind: Kind::Mark(_) | Kind::Comparison, text, at }) => {
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
        let mut values = vec![number(self.nested(Self::sum)?)?];
        while self.take(&[',']).is_some() {
            values.push(number(self.nested(Self::sum)?)?);
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

/// The text of a part that must be a number.
fn number(piece: Piece) -> Result<String, Problem> {
    if piece.is_truth {
        return Err((piece.at, "a condition stands where a number is needed".to_owned()));
    }
    Ok(piece.text)
}

/// Two numbers with a mark between them.
fn computed(left: Piece, mark: char, right: Piece) -> Result<Piece, Problem> {
    let at = left.at;
    Ok(Piece { text: format!("({}{mark}{})", number(left)?, number(right)?), is_truth: false, at })
}

/// Two conditions with `and` or `or`, which stands at `word_at`, between them.
fn joined(left: Piece, mark: &str, right: Piece, word_at: usize) -> Result<Piece, Problem> {
    if !(left.is_truth && right.is_truth) {
        let message = "joins conditions, but a number stands beside it";
        return Err((word_at, message.to_owned()));
    }
    Ok(Piece { text: format!("({}{mark}{})", left.text, right.text), is_truth: true, at: left.at })
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
