//! A struct as a table, an enum as the variants of a tag.

use crate::choice::name_of;
use crate::docs::first_paragraph;
use crate::key::{Key, within};
use proc_macro2::TokenStream;
use quote::quote;
use syn::spanned::Spanned as _;
use syn::{Data, DataEnum, DeriveInput, Error, Expr, Fields, Ident, Result};

pub(crate) fn section(input: &DeriveInput) -> Result<TokenStream> {
    match &input.data {
        Data::Struct(data) => table(input, &data.fields),
        Data::Enum(data) => variants(&input.ident, data),
        Data::Union(_) => Err(Error::new(input.span(), "a section is a struct or an enum")),
    }
}

fn table(input: &DeriveInput, fields: &Fields) -> Result<TokenStream> {
    let own = &input.ident;
    let doc = first_paragraph(&input.attrs);
    let mut open_tag: Option<Expr> = None;
    for attribute in input.attrs.iter().filter(|own| own.path().is_ident("section")) {
        attribute.parse_nested_meta(|meta| {
            if meta.path.is_ident("tag") {
                open_tag = Some(meta.value()?.parse()?);
                Ok(())
            } else {
                Err(meta.error("only tag can be said here"))
            }
        })?;
    }
    let keys = keys(fields)?;
    let fields = descriptions(&keys)?;
    let tag = match (open_tag, keys.iter().find(|key| key.is_tag())) {
        (Some(tag), _) => quote!(::std::option::Option::Some(&#tag)),
        (None, Some(key)) => {
            let (name, doc, default) = (&key.name, key.doc(), key.default_variant());
            let ty = within("Option", &key.field.ty).unwrap_or(&key.field.ty);
            quote!(::std::option::Option::Some(&::proto::config::Tag {
                key: #name,
                doc: #doc,
                default: #default,
                variants: ::proto::config::Variants::Fixed(<#ty as ::proto::config::Alternatives>::VARIANTS),
            }))
        }
        (None, None) => quote!(::std::option::Option::None),
    };
    let values = keys.iter().map(value);
    let assertions = keys.iter().filter_map(Key::assertion);
    Ok(quote! {
        #(#assertions)*

        impl ::proto::config::Section for #own {
            const SPEC: ::proto::config::TableSpec = ::proto::config::TableSpec {
                doc: #doc,
                fields: #fields,
                tag: #tag,
            };

            fn read(table: &::proto::config::CheckedTable) -> Self {
                Self { #(#values),* }
            }
        }
    })
}

/// The list of descriptions, those of flattened sections in their places.
fn descriptions(keys: &[Key<'_>]) -> Result<TokenStream> {
    let own = |keys: &[Key<'_>]| -> Result<TokenStream> {
        let described = keys.iter().filter(|key| key.is_described());
        let descriptions = described.map(Key::description).collect::<Result<Vec<_>>>()?;
        Ok(quote!(&[#(#descriptions),*]))
    };
    if !keys.iter().any(Key::is_flattened) {
        return own(keys);
    }
    let (mut parts, mut counts) = (Vec::new(), Vec::new());
    for run in keys.chunk_by(|one, next| one.is_flattened() == next.is_flattened()) {
        if !run[0].is_flattened() {
            let n = run.iter().filter(|key| key.is_described()).count();
            parts.push(own(run)?);
            counts.push(quote!(#n));
            continue;
        }
        for ty in run.iter().map(|key| &key.field.ty) {
            let fields = quote!(<#ty as ::proto::config::Section>::SPEC.fields);
            counts.push(quote!(#fields.len()));
            parts.push(fields);
        }
    }
    Ok(quote!(&::proto::config::joined::<{ #(#counts)+* }>(&[#(#parts),*])))
}

/// The keys of named fields.
fn keys(fields: &Fields) -> Result<Vec<Key<'_>>> {
    match fields {
        Fields::Named(fields) => fields.named.iter().map(Key::of).collect(),
        Fields::Unit => Ok(Vec::new()),
        Fields::Unnamed(fields) => Err(Error::new(fields.span(), "a key needs a name")),
    }
}

/// `field: read(...)`.
fn value(key: &Key<'_>) -> TokenStream {
    let (ident, name) = (&key.field.ident, &key.name);
    if key.is_flattened() {
        return quote!(#ident: ::proto::config::Section::read(table));
    }
    if key.is_skipped() {
        return quote!(#ident: ::std::default::Default::default());
    }
    if key.is_tag() {
        let is_optional = within("Option", &key.field.ty).is_some();
        let ty = within("Option", &key.field.ty).unwrap_or(&key.field.ty);
        let read = quote!(<#ty as ::proto::config::Alternatives>::read(table, #name));
        return if is_optional {
            quote!(#ident: #read)
        } else {
            // A value that is none was refused; the check has put none in its place, since it judges none of the keys that go with it.
            quote!(#ident: #read.unwrap_or_else(|| <Self as ::proto::config::Section>::defaults().#ident))
        };
    }
    quote!(#ident: ::proto::config::key(table, #name))
}

fn variants(own: &Ident, data: &DataEnum) -> Result<TokenStream> {
    let mut listed = Vec::new();
    let mut arms = Vec::new();
    for variant in &data.variants {
        let name = name_of(&variant.attrs, "section", &variant.ident.to_string())?;
        let doc = first_paragraph(&variant.attrs);
        let ident = &variant.ident;
        if let Fields::Unnamed(fields) = &variant.fields {
            if fields.unnamed.len() != 1 {
                return Err(Error::new(fields.span(), "one section, or named keys"));
            }
            let ty = &fields.unnamed[0].ty;
            listed.push(quote!(::proto::config::Variant {
                name: #name,
                doc: #doc,
                fields: <#ty as ::proto::config::Section>::SPEC.fields,
            }));
            arms.push(
                quote!(#name => Self::#ident(<#ty as ::proto::config::Section>::read(table))),
            );
            continue;
        }
        let keys = keys(&variant.fields)?;
        let fields = descriptions(&keys)?;
        let values = keys.iter().map(value);
        listed.push(quote!(::proto::config::Variant { name: #name, doc: #doc, fields: #fields }));
        arms.push(quote!(#name => Self::#ident { #(#values),* }));
    }
    Ok(quote! {
        impl ::proto::config::Alternatives for #own {
            const VARIANTS: &'static [::proto::config::Variant] = &[#(#listed),*];

            fn read(table: &::proto::config::CheckedTable, tag: &str) -> ::std::option::Option<Self> {
                ::std::option::Option::Some(match ::proto::config::tag(table, tag)? {
                    #(#arms,)*
                    _ => return ::std::option::Option::None,
                })
            }
        }
    })
}
