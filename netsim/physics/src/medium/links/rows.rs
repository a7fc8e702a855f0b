//! What is kept for each sender: who is within its reach, and scatter that lasts while neither end moves.

use crate::link::End;
use crate::nearest::Grid;
use crate::propagation::Reach;
use proto::ids::MoteId;

/// What is kept, by sender.
#[derive(Debug, Default)]
pub(super) struct SenderRows {
    rows: Vec<Row>,
    /// Number of the last change of anyone's place.
    change: u32,
    /// Number of the last change of each mote's place.
    moved_in: Vec<u32>,
    grid: Grid,
    /// For which change the grid holds.
    grid_of: u32,
    /// Values kept.
    n_kept: usize,
    found: Vec<MoteId>,
    values: Vec<f64>,
}

/// What is kept for a sender.
#[derive(Clone, Debug, Default)]
struct Row {
    /// For which change it holds; 0: for none.
    of: u32,
    /// Who may be within reach.
    reach: Neighbours,
    /// Scatter that lasts (dB), in the neighbours' order, not a number where unknown; empty: none is kept.
    lasting_db: Vec<f64>,
}

#[derive(Clone, Debug, Default)]
enum Neighbours {
    /// So many that a list does not pay, of these highest number.
    #[default]
    Everyone,
    /// These, ascending.
    List(Vec<MoteId>),
}

/// Fewer radios than this are not worth lists.
const FEW: usize = 64;
/// More values than this are not kept but computed whenever they are asked for: 128 MB.
const MOST_KEPT: usize = 1 << 24;

impl SenderRows {
    /// Takes note of who has moved, come or gone.
    pub(super) fn note_moves(&mut self, before: (&[End], &[f64]), after: (&[End], &[f64])) {
        self.change += 1;
        let highest = |ends: &[End]| ends.last().map_or(0, |end| end.id.index() + 1);
        let n_motes = highest(before.0).max(highest(after.0));
        if self.moved_in.len() < n_motes {
            self.moved_in.resize(n_motes, 0);
            self.rows.resize(n_motes, Row::default());
        }
        let mut old = before.0.iter().zip(before.1).peekable();
        for (end, way_m) in after.0.iter().zip(after.1) {
            while let Some((gone, _)) = old.next_if(|(old, _)| old.id < end.id) {
                self.moved_in[gone.id.index()] = self.change;
            }
            let same = old.next_if(|(old, _)| old.id == end.id).is_some_and(|(old, old_way_m)| {
                old.position_m == end.position_m && old_way_m == way_m
            });
            if !same {
                self.moved_in[end.id.index()] = self.change;
            }
        }
        for (gone, _) in old {
            self.moved_in[gone.id.index()] = self.change;
        }
    }

    /// Brings the row of the sender at a place among `ends` up to date. `keeps`: values are kept in it.
    pub(super) fn refresh(&mut self, ends: &[End], from: usize, reach: Reach, keeps: bool) {
        let sender = ends[from].id.index();
        if self.rows[sender].of == self.change {
            return;
        }
        let was = self.rows[sender].of;
        // Who stands where he stood when the row was made.
        let moved_in = &self.moved_in;
        let stands = |mote: usize| was != 0 && moved_in[mote] <= was;
        let sender_stands = stands(sender);
        let is_list = self.find(ends, from, reach);
        let Self { rows, found, values, n_kept, moved_in, .. } = self;
        let stands = |mote: usize| sender_stands && moved_in[mote] <= was;
        let row = &mut rows[sender];
        *n_kept -= row.lasting_db.len();
        let n_values = match is_list {
            true => found.len(),
            false => ends.last().map_or(0, |end| end.id.index() + 1),
        };
        values.clear();
        if keeps && *n_kept + n_values <= MOST_KEPT {
            values.resize(n_values, f64::NAN);
            if sender_stands {
                for (place, value) in values.iter_mut().enumerate() {
                    let mote = if is_list { found[place] } else { MoteId::from_index(place) };
                    if stands(mote.index())
                        && let Some(known) = row.place_of(mote)
                    {
                        *value = row.lasting_db[known];
                    }
                }
            }
        }
        *n_kept += values.len();
        std::mem::swap(&mut row.lasting_db, values);
        match (&mut row.reach, is_list) {
            (Neighbours::List(list), true) => std::mem::swap(list, found),
            (reach, true) => *reach = Neighbours::List(found.clone()),
            (reach, false) => *reach = Neighbours::Everyone,
        }
        row.of = self.change;
    }

    /// Lists in `found` who is within reach. Whether a list pays.
    fn find(&mut self, ends: &[End], from: usize, reach: Reach) -> bool {
        self.found.clear();
        let Reach::Within(reach_m) = reach else { return false };
        if ends.len() < FEW {
            return false;
        }
        if self.grid_of != self.change {
            let points = ends.iter().map(|end| [end.position_m[0], end.position_m[1]]);
            self.grid.build(reach_m, points);
            self.grid_of = self.change;
        }
        let sender = &ends[from];
        let [x, y, _] = sender.position_m;
        for place in self.grid.around([x, y], reach_m) {
            let other = &ends[place as usize];
            if other.id != sender.id && sender.distance_squared_m2(other) <= reach_m * reach_m {
                self.found.push(other.id);
            }
            if ends.len() / 2 < self.found.len() {
                return false;
            }
        }
        self.found.sort_unstable();
        true
    }

    /// Who may be within reach of a sender whose row is up to date.
    pub(super) fn neighbours(&self, sender: MoteId) -> Option<&[MoteId]> {
        match &self.rows[sender.index()].reach {
            Neighbours::Everyone => None,
            Neighbours::List(list) => Some(list),
        }
    }

    /// The scatter that lasts on a link within reach, of a sender whose row is up to date.
    #[inline]
    pub(super) fn lasting_db(
        &mut self,
        sender: MoteId,
        receiver: MoteId,
        compute_db: impl FnOnce() -> f64,
    ) -> f64 {
        let row = &mut self.rows[sender.index()];
        let Some(place) = row.place_of(receiver) else { return compute_db() };
        let kept = &mut row.lasting_db[place];
        if kept.is_nan() {
            *kept = compute_db();
        }
        *kept
    }
}

impl Row {
    /// Where the value for a receiver is kept, if it is.
    #[inline]
    fn place_of(&self, receiver: MoteId) -> Option<usize> {
        let place = match &self.reach {
            Neighbours::Everyone => receiver.index(),
            Neighbours::List(list) => list.binary_search(&receiver).ok()?,
        };
        (place < self.lasting_db.len()).then_some(place)
    }
}
