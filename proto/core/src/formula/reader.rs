//! Reads an expression, says where it is wrong, and translates it into a program.
//!
//! Each method reads one rank of operators and appends the operations of what it has read to the program, operands
//! first.

use super::MOST_DEEP;
use super::operators::{
    self, Binary, COMPARISONS, CONSTANTS, FUNCTIONS, Function, POWERS, PRODUCTS, SUMS,
};
use super::program::Program;

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
    /// What it computes.
    pub(super) program: Program,
    /// The names, in the order in which they first appear.
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
    let mut reader = Parser {
        tokens: &tokens,
        next: 0,
        end: text.len(),
        depth: 0,
        program: Program::default(),
        names: Vec::new(),
        want,
        known,
        accepts,
    };
    let whole = reader.disjunction()?;
    match reader.peek() {
        None if want == Want::Truth && !whole.is_truth => Err((
            text.len(),
            "is a number, not a condition; compare it with another number by < <= > >= == or !="
                .to_owned(),
        )),
        None => Ok(Read { program: reader.program, names: reader.names }),
        Some(Token { kind: Kind::Mark(_) | Kind::Comparison(_), text, at }) => {
            Err((*at, format!("unexpected {text}")))
        }
        Some(token) => Err((token.at, format!("expected an operator before {}", token.text))),
    }
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Number(f64),
    Name,
    Mark(char),
    Comparison(Binary),
}

/// A part of an expression that was read: its value is then on top of the program's stack.
#[derive(Clone, Copy)]
struct Piece {
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
                match COMPARISONS.iter().find(|(text, _)| rest.starts_with(text)) {
                    Some((text, compare)) => (Kind::Comparison(*compare), text.len()),
                    None if first == '=' => {
                        return Err((at, "unexpected =; use == for equality".to_owned()));
                    }
                    None => {
                        return Err((
                            at,
                            "unexpected !; use not for conditions, or != for numbers".to_owned(),
                        ));
                    }
                }
            }
            '&' | '|' if want == Want::Truth => {
                let word = if first == '&' { "and" } else { "or" };
                return Err((at, format!("unexpected {first}; use {word}")));
            }
            _ => return Err((at, format!("unexpected {first}"))),
        };
        tokens.push(Token { kind, text: &rest[..length], at });
        at += length;
    }
    Ok(tokens)
}

struct Parser<'a> {
    tokens: &'a [Token<'a>],
    next: usize,
    /// Length of the expression.
    end: usize,
    depth: usize,
    program: Program,
    names: Vec<String>,
    want: Want,
    known: &'a [&'a str],
    accepts: &'a dyn Fn(&str) -> bool,
}

impl<'a> Parser<'a> {
    fn peek(&self) -> Option<&'a Token<'a>> {
        self.tokens.get(self.next)
    }

    /// Whether this mark is next, which is then taken.
    fn take(&mut self, mark: char) -> bool {
        let is_next =
            matches!(self.peek(), Some(Token { kind: Kind::Mark(next), .. }) if *next == mark);
        self.next += usize::from(is_next);
        is_next
    }

    /// Takes the mark of one of these operators, if it is next.
    fn take_operator(&mut self, operators: &[(char, Binary)]) -> Option<Binary> {
        let (_, apply) = operators.iter().find(|(mark, _)| self.take(*mark))?;
        Some(*apply)
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
        let is_name = matches!(token.kind, Kind::Name);
        let is_it = self.want == Want::Truth && is_name && token.text == word;
        is_it.then(|| {
            self.next += 1;
            token.at
        })
    }

    /// Where the next token begins.
    fn position(&self) -> usize {
        self.peek().map_or(self.end, |token| token.at)
    }

    /// All that may stand between parentheses.
    fn disjunction(&mut self) -> Result<Piece, Problem> {
        let mut left = self.conjunction()?;
        while let Some(at) = self.take_word("or") {
            let right = self.conjunction()?;
            left = self.joined(left, operators::or, right, at)?;
        }
        Ok(left)
    }

    fn conjunction(&mut self) -> Result<Piece, Problem> {
        let mut left = self.negation()?;
        while let Some(at) = self.take_word("and") {
            let right = self.negation()?;
            left = self.joined(left, operators::and, right, at)?;
        }
        Ok(left)
    }

    fn negation(&mut self) -> Result<Piece, Problem> {
        let Some(at) = self.take_word("not") else { return self.comparison() };
        let inner = self.nested(Self::negation)?;
        if !inner.is_truth {
            return Err((inner.at, "expected a condition after not, got a number".to_owned()));
        }
        self.program.unary(operators::not);
        Ok(Piece { is_truth: true, at })
    }

    fn comparison(&mut self) -> Result<Piece, Problem> {
        let left = self.sum()?;
        let Some(&Token { kind: Kind::Comparison(compare), .. }) = self.peek() else {
            return Ok(left);
        };
        self.next += 1;
        let right = self.sum()?;
        left.number()?;
        right.number()?;
        if let Some(Token { kind: Kind::Comparison(_), text, at }) = self.peek() {
            let message = format!("unexpected {text}; join two comparisons with and");
            return Err((*at, message));
        }
        self.program.binary(compare);
        Ok(Piece { is_truth: true, at: left.at })
    }

    fn sum(&mut self) -> Result<Piece, Problem> {
        let mut left = self.product()?;
        while let Some(apply) = self.take_operator(SUMS) {
            let right = self.product()?;
            left = self.computed(left, apply, right)?;
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Piece, Problem> {
        let mut left = self.signed()?;
        while let Some(apply) = self.take_operator(PRODUCTS) {
            let right = self.signed()?;
            left = self.computed(left, apply, right)?;
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Piece, Problem> {
        let at = self.position();
        let is_negative = self.take('-');
        if !is_negative && !self.take('+') {
            return self.power();
        }
        self.nested(Self::signed)?.number()?;
        if is_negative {
            self.program.unary(operators::negative);
        }
        Ok(Piece { is_truth: false, at })
    }

    fn power(&mut self) -> Result<Piece, Problem> {
        let base = self.primary()?;
        match self.take_operator(POWERS) {
            Some(apply) => {
                let exponent = self.nested(Self::signed)?;
                self.computed(base, apply, exponent)
            }
            None => Ok(base),
        }
    }

    fn primary(&mut self) -> Result<Piece, Problem> {
        let Some(token) = self.peek() else {
            return Err((self.end, "expected a number, a name or ( at the end".to_owned()));
        };
        let at = token.at;
        match token.kind {
            Kind::Number(number) => {
                self.next += 1;
                self.program.number(number);
                Ok(Piece { is_truth: false, at })
            }
            Kind::Name => {
                self.next += 1;
                if self.take('(') {
                    self.call(token)?;
                } else {
                    self.name(token)?;
                }
                Ok(Piece { is_truth: false, at })
            }
            Kind::Mark('(') => {
                self.next += 1;
                let inner = self.nested(Self::disjunction)?;
                self.close(token)?;
                Ok(Piece { at, ..inner })
            }
            Kind::Mark(_) | Kind::Comparison(_) => {
                Err((token.at, format!("expected a number, a name or ( before {}", token.text)))
            }
        }
    }

    /// The end of what `opened`.
    fn close(&mut self, opened: &Token<'_>) -> Result<(), Problem> {
        if self.take(')') {
            return Ok(());
        }
        match self.peek() {
            None => Err((opened.at, format!("{} is not closed", opened.text))),
            Some(Token { kind: Kind::Mark(_) | Kind::Comparison(_), text, at }) => {
                Err((*at, format!("unexpected {text}")))
            }
            Some(token) => Err((token.at, format!("expected an operator before {}", token.text))),
        }
    }

    fn call(&mut self, called: &Token<'_>) -> Result<(), Problem> {
        let name = called.text;
        let Some(&(_, function)) = FUNCTIONS.iter().find(|(known, _)| *known == name) else {
            let hint = hint(name, FUNCTIONS.iter().map(|(known, _)| *known));
            return Err((called.at, format!("unknown function {name}{hint}")));
        };
        self.nested(Self::sum)?.number()?;
        let mut n_values = 1;
        while self.take(',') {
            self.nested(Self::sum)?.number()?;
            n_values += 1;
        }
        self.close(called)?;
        match function {
            Function::Unary(apply) if n_values == 1 => self.program.unary(apply),
            Function::Binary(apply) if n_values == 2 => self.program.binary(apply),
            Function::Unary(_) => return Err((called.at, format!("{name} takes 1 value"))),
            Function::Binary(_) => return Err((called.at, format!("{name} takes 2 values"))),
        }
        Ok(())
    }

    fn name(&mut self, token: &Token<'_>) -> Result<(), Problem> {
        let name = token.text;
        let place = match self.names.iter().position(|used| used == name) {
            Some(place) => place,
            None => {
                if !self.known.contains(&name) {
                    if let Some((_, constant)) = CONSTANTS.iter().find(|(known, _)| *known == name)
                    {
                        self.program.number(*constant);
                        return Ok(());
                    }
                    if FUNCTIONS.iter().any(|(known, _)| *known == name) {
                        let message = format!("{name} is a function; expected ( after it");
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
        self.program.name(place);
        Ok(())
    }

    /// Two numbers with an operator between them.
    fn computed(&mut self, left: Piece, apply: Binary, right: Piece) -> Result<Piece, Problem> {
        left.number()?;
        right.number()?;
        self.program.binary(apply);
        Ok(Piece { is_truth: false, at: left.at })
    }

    /// Two conditions with `and` or `or`, which stands at `word_at`, between them.
    fn joined(
        &mut self,
        left: Piece,
        apply: Binary,
        right: Piece,
        word_at: usize,
    ) -> Result<Piece, Problem> {
        if !(left.is_truth && right.is_truth) {
            let message = "joins two conditions, but one side is a number";
            return Err((word_at, message.to_owned()));
        }
        self.program.binary(apply);
        Ok(Piece { is_truth: true, at: left.at })
    }
}

impl Piece {
    /// Refuses a condition where a number is needed.
    fn number(self) -> Result<(), Problem> {
        if self.is_truth {
            return Err((self.at, "expected a number, got a condition".to_owned()));
        }
        Ok(())
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
