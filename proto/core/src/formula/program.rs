//! An expression as a program: operations in postfix order, each of which takes its operands off a stack.
//!
//! No library evaluates it: the reader produces the operations anyway, and results must be the same on every processor. So the
//! functions are those of `libm`, and operations keep the order of the expression.

/// An expression that can be evaluated. Empty until the reader has pushed its operations.
#[derive(Clone, Debug, Default)]
pub(super) struct Program {
    operations: Vec<Operation>,
    /// Values on the stack after the operations so far.
    depth: usize,
    /// The most values that are ever on the stack.
    max_depth: usize,
}

#[derive(Clone, Copy, Debug)]
enum Operation {
    Number(f64),
    /// The value of the name at this place among the expression's names.
    Name(usize),
    Unary(fn(f64) -> f64),
    /// Of the value below the top of the stack, and the top.
    Binary(fn(f64, f64) -> f64),
}

impl Program {
    /// Pushes a number.
    pub(super) fn number(&mut self, number: f64) {
        self.push(Operation::Number(number));
    }

    /// Pushes the value of a name, by its place among the expression's names.
    pub(super) fn name(&mut self, place: usize) {
        self.push(Operation::Name(place));
    }

    fn push(&mut self, operand: Operation) {
        self.operations.push(operand);
        self.depth += 1;
        self.max_depth = self.max_depth.max(self.depth);
    }

    /// Replaces the top of the stack by a function of it; at once where it is a number.
    pub(super) fn unary(&mut self, apply: fn(f64) -> f64) {
        if let Some(Operation::Number(number)) = self.operations.last_mut() {
            *number = apply(*number);
        } else {
            self.operations.push(Operation::Unary(apply));
        }
    }

    /// Replaces the two values on top of the stack by a function of them; at once where both are numbers.
    pub(super) fn binary(&mut self, apply: fn(f64, f64) -> f64) {
        self.depth -= 1;
        if let [.., Operation::Number(left), Operation::Number(right)] = &mut self.operations[..] {
            *left = apply(*left, *right);
            self.operations.pop();
        } else {
            self.operations.push(Operation::Binary(apply));
        }
    }

    /// The value of the whole expression, given those of its names in their order. Allocates only where more than
    /// [`SHALLOW`] values are on the stack at once.
    pub(super) fn evaluate(&self, values: &[f64]) -> f64 {
        let mut shallow = [0.0; SHALLOW];
        match shallow.get_mut(..self.max_depth) {
            Some(stack) => self.evaluate_on(stack, values),
            None => self.evaluate_on(&mut vec![0.0; self.max_depth], values),
        }
    }

    fn evaluate_on(&self, stack: &mut [f64], values: &[f64]) -> f64 {
        let mut depth = 0;
        for operation in &self.operations {
            match *operation {
                Operation::Number(number) => {
                    stack[depth] = number;
                    depth += 1;
                }
                Operation::Name(place) => {
                    stack[depth] = values[place];
                    depth += 1;
                }
                Operation::Unary(apply) => stack[depth - 1] = apply(stack[depth - 1]),
                Operation::Binary(apply) => {
                    depth -= 1;
                    stack[depth - 1] = apply(stack[depth - 1], stack[depth]);
                }
            }
        }
        stack[0]
    }
}

/// Values that the stack holds without allocating. `a + b * c ^ d` needs four; few expressions need more than eight.
const SHALLOW: usize = 16;
