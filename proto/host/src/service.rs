//! The calls of both services: they differ in the names of the generated types alone.

/// Implements the service of a host, and those of its calls that are alike.
///
/// * `$messages`: the module with the service's messages.
/// * `$more`: calls that the other service does not have.
macro_rules! service {
    ($service:ident for $host:ident, $simulator:ident, $messages:ident { $($more:tt)* }) => {
        impl<S: $simulator> Lifecycle<S> {
            fn version() -> String {
                format!("{} {}", S::NAME, env!("CARGO_PKG_VERSION"))
            }

            fn barrier(
                &mut self,
                request: &$messages::BarrierRequest,
            ) -> Result<$messages::BarrierResponse, Status> {
                let ledger = &self.active()?.ledger;
                ledger.barrier(request.step)?;
                let Ledger { step, time_ns, .. } = *ledger;
                Ok($messages::BarrierResponse { step, time_ns, digest: ledger.digest() })
            }

            fn snapshot(&mut self) -> Result<$messages::SnapshotResponse, Status> {
                let state = self.frozen(Self::version(), S::snapshot)?;
                Ok($messages::SnapshotResponse { state })
            }

            fn restore(
                &mut self,
                request: &$messages::RestoreRequest,
            ) -> Result<$messages::RestoreResponse, Status> {
                let (state, seed) = (&request.state, request.seed);
                let ledger =
                    self.restored(state, &Self::version(), seed, S::restore, S::reseed)?;
                let Ledger { step, time_ns, .. } = *ledger;
                Ok($messages::RestoreResponse { step, time_ns })
            }
        }

        #[tonic::async_trait]
        impl<S: $simulator> $service for $host<S> {
            async fn describe(
                &self,
                _: Request<$messages::DescribeRequest>,
            ) -> Result<Response<$messages::DescribeResponse>, Status> {
                Ok(Response::new($host::describe(self)))
            }

            async fn configure(
                &self,
                request: Request<$messages::ConfigureRequest>,
            ) -> Result<Response<$messages::ConfigureResponse>, Status> {
                let configure = |host: &mut Lifecycle<S>| host.configure(request.into_inner());
                self.shared.call_blocking(configure).await.map(Response::new)
            }

            async fn step(
                &self,
                request: Request<$messages::StepRequest>,
            ) -> Result<Response<$messages::StepResponse>, Status> {
                self.shared.call(|host| host.step(request.into_inner())).await.map(Response::new)
            }

            async fn barrier(
                &self,
                request: Request<$messages::BarrierRequest>,
            ) -> Result<Response<$messages::BarrierResponse>, Status> {
                let barrier = move |host: &mut Lifecycle<S>| host.barrier(request.get_ref());
                self.shared.call(barrier).await.map(Response::new)
            }

            type SessionStream = BoxStream<'static, Result<$messages::SessionResponse, Status>>;

            async fn session(
                &self,
                request: Request<Streaming<$messages::SessionRequest>>,
            ) -> Result<Response<Self::SessionStream>, Status> {
                use $messages::{SessionCall as Call, SessionReply as Reply};
                let shared = self.shared.clone();
                let reply = |(mut calls, shared): (Streaming<_>, Shared<S, Active>)| async move {
                    let Some($messages::SessionRequest { request }) = calls.message().await? else {
                        return Ok(None);
                    };
                    let reply = match request {
                        Some(Call::Step(step)) => {
                            Reply::Step(shared.call(|host| host.step(step)).await?)
                        }
                        Some(Call::Barrier(barrier)) => {
                            Reply::Barrier(shared.call(move |host| host.barrier(&barrier)).await?)
                        }
                        None => return Err(Status::invalid_argument("request: is missing")),
                    };
                    let reply = $messages::SessionResponse { response: Some(reply) };
                    Ok(Some((reply, (calls, shared))))
                };
                Ok(Response::new(try_unfold((request.into_inner(), shared), reply).boxed()))
            }

            async fn snapshot(
                &self,
                _: Request<$messages::SnapshotRequest>,
            ) -> Result<Response<$messages::SnapshotResponse>, Status> {
                self.shared.call_blocking(Lifecycle::snapshot).await.map(Response::new)
            }

            async fn restore(
                &self,
                request: Request<$messages::RestoreRequest>,
            ) -> Result<Response<$messages::RestoreResponse>, Status> {
                let restore = move |host: &mut Lifecycle<S>| host.restore(request.get_ref());
                self.shared.call_blocking(restore).await.map(Response::new)
            }

            async fn command(
                &self,
                request: Request<$messages::CommandRequest>,
            ) -> Result<Response<$messages::CommandResponse>, Status> {
                self.orders.admit(&request)?;
                self.shared.call(|host| host.command(request.into_inner())).await.map(Response::new)
            }

            $($more)*
        }
    };
}

pub(crate) use service;
