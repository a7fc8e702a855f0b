//! Whether a simulator that is restored with another seed draws by that seed.

use super::probe::Probe;
use super::{ContractVerdict, Finding, N_STEPS, Questions, STEP_NS, status_text, within};
use bytes::Bytes;
use drive::peer::Described;

pub(super) const CONTINUES: &str = "a restored snapshot goes on as if the simulator had never stopped, without a seed and with the one that it had";
pub(super) const RESEEDS: &str = "a snapshot restored with another seed gives the same replies each time, and others than with the one that it had";

/// Promises about snapshots, and whether a simulator keeps them.
pub(super) async fn judged<S: Probe>(
    questions: &Questions<'_, S>,
    described: &Described,
) -> Vec<Finding> {
    if !described.reseed {
        return [CONTINUES, RESEEDS].map(|it| (it, ContractVerdict::NotAnnounced)).into();
    }
    if !described.snapshots {
        let reason = "announces reseed and not snapshots".to_owned();
        return vec![(CONTINUES, ContractVerdict::Broken(reason))];
    }
    match questions.saved().await {
        Err(reason) => vec![(CONTINUES, ContractVerdict::Broken(reason))],
        Ok((state, replies)) => {
            let continues = questions.continues(&state, &replies).await;
            let reseeds = questions.reseeds(&state, &replies).await;
            vec![(CONTINUES, continues.into()), (RESEEDS, reseeds)]
        }
    }
}

/// The seed of the experiment that is saved.
const SEED: u64 = 1;
/// Other seeds. Each is tried until one gives other replies.
const OTHERS: [u64; 4] = [2, 3, 1 << 40, u64::MAX];

impl<S: Probe> Questions<'_, S> {
    /// A snapshot after some steps, and the replies to the steps that follow it.
    async fn saved(&self) -> Result<(Bytes, Vec<Vec<u8>>), String> {
        self.configure(SEED).await?;
        self.run(1).await?;
        let state = within(S::snapshot(self.client.clone())).await.map_err(status_text)?;
        Ok((state, self.further().await?))
    }

    /// The replies to the steps that follow the snapshot.
    async fn further(&self) -> Result<Vec<Vec<u8>>, String> {
        let mut replies = Vec::new();
        for step in N_STEPS + 1..=2 * N_STEPS {
            replies.push(S::bytes(self.step(step).await?));
        }
        Ok(replies)
    }

    /// The replies after the snapshot is restored.
    async fn restored(&self, state: &Bytes, seed: Option<u64>) -> Result<Vec<Vec<u8>>, String> {
        let call = S::restore(self.client.clone(), state.clone(), seed);
        let at = within(call).await.map_err(status_text)?;
        if at != (N_STEPS, N_STEPS * STEP_NS) {
            return Err(format!(
                "Restore of a snapshot after step {N_STEPS} reports step {}, {} ns",
                at.0, at.1
            ));
        }
        self.further().await
    }

    async fn continues(&self, state: &Bytes, replies: &[Vec<u8>]) -> Result<(), String> {
        for seed in [None, Some(SEED)] {
            if self.restored(state, seed).await? != replies {
                let with = seed.map_or("without a seed", |_| "with the seed that it had");
                return Err(format!("restored {with}, its replies differ"));
            }
        }
        Ok(())
    }

    async fn reseeds(&self, state: &Bytes, replies: &[Vec<u8>]) -> ContractVerdict {
        for seed in OTHERS {
            let twice = async {
                let first = self.restored(state, Some(seed)).await?;
                Ok::<_, String>((self.restored(state, Some(seed)).await?, first))
            };
            match twice.await {
                Err(reason) => return ContractVerdict::Broken(reason),
                Ok((again, first)) if again != first => {
                    let reason = format!("the replies differ between two times with seed {seed}");
                    return ContractVerdict::Broken(reason);
                }
                Ok((_, first)) if first != replies => return ContractVerdict::Kept,
                Ok(_) => {}
            }
        }
        ContractVerdict::Undecided(
            "no seed changes the replies: either nothing is drawn under this configuration, or Restore.seed is ignored; give \
             a configuration with random draws (--config)"
                .to_owned(),
        )
    }
}
