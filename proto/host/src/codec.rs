//! How messages become bytes on the wire and back: as protobuf prescribes, whole messages at a time.
//!
//! The codec that tonic comes with writes every number of a packed array by a call of its own into a buffer that grows
//! as it fills. Ten thousand robots are a megabyte of such numbers in each of four messages of a step. Here a message is
//! written into memory of its own of the right size, and read from memory that is no longer added to; the bytes are the
//! same.

use bytes::{Buf as _, BufMut as _};
use prost::Message;
use std::marker::PhantomData;
use tonic::Status;
use tonic::codec::{DecodeBuf, Decoder, EncodeBuf, Encoder};

/// Messages `T` out, messages `U` in.
#[derive(Clone, Debug)]
pub struct Codec<T, U> {
    messages: PhantomData<(T, U)>,
}

/// Writes messages or reads them.
#[derive(Clone, Debug)]
pub struct Whole<T> {
    messages: PhantomData<T>,
}

impl<T, U> Default for Codec<T, U> {
    fn default() -> Self {
        Self { messages: PhantomData }
    }
}

impl<T> Default for Whole<T> {
    fn default() -> Self {
        Self { messages: PhantomData }
    }
}

impl<T, U> tonic::codec::Codec for Codec<T, U>
where
    T: Message + Send + 'static,
    U: Message + Default + Send + 'static,
{
    type Encode = T;
    type Decode = U;
    type Encoder = Whole<T>;
    type Decoder = Whole<U>;

    fn encoder(&mut self) -> Whole<T> {
        Whole::default()
    }

    fn decoder(&mut self) -> Whole<U> {
        Whole::default()
    }
}

impl<T: Message> Encoder for Whole<T> {
    type Item = T;
    type Error = Status;

    fn encode(&mut self, item: T, buffer: &mut EncodeBuf<'_>) -> Result<(), Status> {
        let bytes = item.encode_to_vec();
        buffer.reserve(bytes.len());
        buffer.put_slice(&bytes);
        Ok(())
    }
}

impl<U: Message + Default> Decoder for Whole<U> {
    type Item = U;
    type Error = Status;

    fn decode(&mut self, buffer: &mut DecodeBuf<'_>) -> Result<Option<U>, Status> {
        // Not copied: taken out of the buffer.
        let bytes = buffer.copy_to_bytes(buffer.remaining());
        U::decode(bytes).map(Some).map_err(|error| Status::internal(error.to_string()))
    }
}
