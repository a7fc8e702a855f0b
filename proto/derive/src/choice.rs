//! An enum as one of several texts.

use crate::docs::{first_paragraph, kebab_case};
use proc_macro2::TokenStream;
use quote::quote;
use syn::spanned::Spanned as _;
use syn::{Attribute, Data, DeriveInput, Error, Fields, LitStr, Result};

pub(crate) fn choice(input: &DeriveInput) -> Result<TokenStream> {
    let Data::Enum(data) = &input.data else {
        return Err(Error::new(input.span(), "a choice is an enum"));
    };
    let own = &input.ident;
    let mut names = Vec::new();
    let mut docs = Vec::new();
    let mut idents = Vec::new();
    for variant in &data.variants {
        if !matches!(variant.fields, Fields::Unit) {
            return Err(Error::new(variant.span(), "a choice holds nothing: derive Section"));
        }
        names.push(name_of(&variant.attrs, "choice", &variant.ident.to_string())?);
        docs.push(first_paragraph(&variant.attrs));
        idents.push(&variant.ident);
    }
    Ok(quote! {
        impl #own {
            /// As it is written.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { #(Self::#idents => #names,)* }
            }
        }

        impl ::proto::config::Key for #own {
            const KIND: ::proto::config::Kind = ::proto::config::Kind::Choice(&[
                #(::proto::config::Choice { name: #names, doc: #docs },)*
            ]);

            fn from_value(value: &::proto::config::CheckedValue) -> ::std::option::Option<Self> {
                match value.as_str()? {
                    #(#names => ::std::option::Option::Some(Self::#idents),)*
                    _ => ::std::option::Option::None,
                }
            }
        }
    })
}

/// The name of a variant: in kebab case, or what `#[choice(name = "...")]` says.
pub(crate) fn name_of(attributes: &[Attribute], attribute: &str, ident: &str) -> Result<String> {
    let mut name = kebab_case(ident);
    for own in attributes.iter().filter(|own| own.path().is_ident(attribute)) {
        own.parse_nested_meta(|meta| {
            if meta.path.is_ident("name") {
                name = meta.value()?.parse::<LitStr>()?.value();
                Ok(())
            } else {
                Err(meta.error("only name can be said here"))
            }
        })?;
    }
    Ok(name)
}
