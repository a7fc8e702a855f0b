//! The loop of a stepwise selection: forward selection, in which a round may also exchange and remove what earlier rounds added. Three
//! searches share it: for effects that a model of links or robots lacks, for changes between two campaigns, and for effects that a whole
//! network lacks.

/// What a round did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Round {
    /// It changed the selection.
    Changed,
    /// Nothing more is acceptable.
    Finished,
    /// It was cut short: what it has decided may rest on some of the candidates, or on fits that have not converged.
    Stopped,
}

/// A search that selects round by round.
pub trait Stepwise {
    /// What is selected.
    type Selection: Clone;
    /// Why a round may fail.
    type Error;

    /// Whether another round may follow, after so many.
    fn may_go_on(&self, selection: &Self::Selection, rounds: usize) -> bool;

    /// One round, numbered from 1.
    ///
    /// # Errors
    ///
    /// Whatever prevents a result.
    fn round(
        &mut self,
        selection: &mut Self::Selection,
        round: usize,
    ) -> Result<Round, Self::Error>;
}

/// How a selection ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// How many rounds were begun.
    pub rounds: usize,
    /// How the last of them ended; [`Round::Changed`]: no other may follow.
    pub last: Round,
}

impl Ended {
    /// The round that was stopped, if one was.
    #[must_use]
    pub fn stopped_in(self) -> Option<usize> {
        (self.last == Round::Stopped).then_some(self.rounds)
    }
}

/// Runs rounds until one finds nothing more, is stopped, or no other may follow. A round that is stopped leaves the selection as it was
/// before.
///
/// # Errors
///
/// A round failed.
pub fn select<S: Stepwise>(
    search: &mut S,
    selection: &mut S::Selection,
) -> Result<Ended, S::Error> {
    let mut ended = Ended { rounds: 0, last: Round::Changed };
    while ended.last == Round::Changed && search.may_go_on(selection, ended.rounds) {
        ended.rounds += 1;
        let before = selection.clone();
        ended.last = search.round(selection, ended.rounds)?;
        if ended.last == Round::Stopped {
            *selection = before;
        }
    }
    Ok(ended)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adds the number of each round, up to three, and is stopped or fails in one.
    struct Counting {
        stopped_in: usize,
        fails_in: usize,
        most: usize,
    }

    impl Stepwise for Counting {
        type Selection = Vec<usize>;
        type Error = usize;

        fn may_go_on(&self, _: &Vec<usize>, rounds: usize) -> bool {
            rounds < self.most
        }

        fn round(&mut self, selection: &mut Vec<usize>, round: usize) -> Result<Round, usize> {
            if round == 4 {
                return Ok(Round::Finished);
            }
            selection.push(round);
            if round == self.fails_in {
                return Err(round);
            }
            Ok(if round == self.stopped_in { Round::Stopped } else { Round::Changed })
        }
    }

    fn selected(mut search: Counting) -> (Vec<usize>, Result<Ended, usize>) {
        let mut selection = Vec::new();
        let ended = select(&mut search, &mut selection);
        (selection, ended)
    }

    #[test]
    fn rounds_go_on_until_one_finds_nothing_more() {
        let (selection, ended) = selected(Counting { stopped_in: 0, fails_in: 0, most: 9 });
        assert_eq!(selection, [1, 2, 3]);
        assert_eq!(ended, Ok(Ended { rounds: 4, last: Round::Finished }));
    }

    #[test]
    fn no_round_follows_where_none_may() {
        let (selection, ended) = selected(Counting { stopped_in: 0, fails_in: 0, most: 2 });
        assert_eq!(selection, [1, 2]);
        assert_eq!(ended, Ok(Ended { rounds: 2, last: Round::Changed }));
    }

    #[test]
    fn a_round_that_is_stopped_leaves_no_trace() {
        let (selection, ended) = selected(Counting { stopped_in: 2, fails_in: 0, most: 9 });
        assert_eq!(selection, [1]);
        assert_eq!(ended.unwrap().stopped_in(), Some(2));
    }

    #[test]
    fn a_round_that_fails_ends_the_selection() {
        let (_, ended) = selected(Counting { stopped_in: 0, fails_in: 3, most: 9 });
        assert_eq!(ended, Err(3));
    }
}
