//! An enum as one of several kinds of values.

use crate::key::Key;
use proc_macro2::TokenStream;
use quote::quote;
use syn::spanned::Spanned as _;
use syn::{Data, DeriveInput, Error, Fields, Result};

pub(crate) fn one_of(input: &DeriveInput) -> Result<TokenStream> {
    let Data::Enum(data) = &input.data else {
        return Err(Error::new(input.span(), "one of several kinds is an enum"));
    };
    let own = &input.ident;
    let (mut kinds, mut reads) = (Vec::new(), Vec::new());
    for variant in &data.variants {
        let (ident, Fields::Unnamed(fields)) = (&variant.ident, &variant.fields) else {
            return Err(Error::new(variant.span(), "a variant has one field without a name"));
        };
        let [field] = &fields.unnamed.iter().collect::<Vec<_>>()[..] else {
            return Err(Error::new(fields.span(), "a variant has one field"));
        };
        let ty = &field.ty;
        kinds.push(Key::of(field)?.kind()?);
        reads.push(quote!(<#ty as ::proto::config::Key>::from_value(value).map(Self::#ident)));
    }
    Ok(quote! {
        impl ::proto::config::Key for #own {
            const KIND: ::proto::config::Kind = ::proto::config::Kind::Either(&[#(#kinds),*]);

            fn from_value(value: &::proto::config::CheckedValue) -> ::std::option::Option<Self> {
                ::std::option::Option::None #(.or_else(|| #reads))*
            }
        }
    })
}
