//! What an effect says about itself.

use crate::docs::under;
use crate::key::{Key, ends};
use proc_macro2::TokenStream;
use quote::quote;
use syn::spanned::Spanned as _;
use syn::{Attribute, Data, DeriveInput, Error, Expr, Fields, Ident, LitStr, Result};

pub(crate) fn catalogued(input: &DeriveInput) -> Result<TokenStream> {
    let Data::Struct(data) = &input.data else {
        return Err(Error::new(input.span(), "an effect is a struct"));
    };
    let own = &input.ident;
    let said = Said::of(&input.attrs)?;
    let name = said.name.ok_or_else(|| Error::new(own.span(), "#[effect(name = \"...\")]"))?;
    let makes = said.makes.unwrap_or_else(|| own.clone());
    let needs = said.needs.map_or(quote!(&[]), |needs| quote!(#needs));
    let example = said.example.unwrap_or_default();
    let part = |heading: &str| {
        let text = under(heading, &input.attrs);
        text.ok_or_else(|| Error::new(own.span(), format!("the documentation lacks # {heading}")))
    };
    let [mechanism, equation, source, validity, trace] =
        [part("Mechanism")?, part("Equation")?, part("Source")?, part("Validity")?, part("Trace")?];
    let (names, values): (Vec<Ident>, Vec<Expr>) = said.fit.into_iter().unzip();
    let parameters = parameters(&data.fields)?;
    let parameters = if names.iter().any(|name| name == "parameters") {
        quote!()
    } else {
        quote!(parameters: &[#(#parameters),*],)
    };
    Ok(quote! {
        impl ::proto::effect::Named for #makes {
            fn name(&self) -> &'static str {
                #name
            }
        }

        impl ::proto::effect::Catalogued for #own {
            const NAME: &'static str = #name;
            const ABOUT: ::proto::effect::About = ::proto::effect::About {
                mechanism: #mechanism,
                equation: #equation,
                source: #source,
                validity: #validity,
                trace: #trace,
                needs: #needs,
                example: #example,
            };
            const FIT: ::proto::effect::Fit = ::proto::effect::Fit {
                #parameters
                #(#names: #values,)*
                ..::proto::effect::Fit::PLAIN
            };
        }
    })
}

/// What `#[effect(...)]` says.
#[derive(Default)]
struct Said {
    name: Option<LitStr>,
    makes: Option<Ident>,
    needs: Option<Expr>,
    example: Option<String>,
    fit: Vec<(Ident, Expr)>,
}

impl Said {
    fn of(attributes: &[Attribute]) -> Result<Self> {
        let mut said = Self::default();
        for attribute in attributes.iter().filter(|own| own.path().is_ident("effect")) {
            attribute.parse_nested_meta(|meta| {
                let word = meta.path.require_ident()?.clone();
                match word.to_string().as_str() {
                    "name" => said.name = Some(meta.value()?.parse()?),
                    "makes" => said.makes = Some(meta.value()?.parse()?),
                    "needs" => said.needs = Some(meta.value()?.parse()?),
                    "example" => said.example = Some(meta.value()?.parse::<LitStr>()?.value()),
                    _ => said.fit.push((word, meta.value()?.parse()?)),
                }
                Ok(())
            })?;
        }
        Ok(said)
    }
}

/// `Parameter { ... }` of each `#[fit(...)]`, in the order of the fields.
fn parameters(fields: &Fields) -> Result<Vec<TokenStream>> {
    let Fields::Named(fields) = fields else { return Ok(Vec::new()) };
    let mut parameters = Vec::new();
    for field in &fields.named {
        let key = Key::of(field)?;
        for attribute in field.attrs.iter().filter(|own| own.path().is_ident("fit")) {
            let mut name = key.name.clone();
            let mut unit = String::new();
            let (mut range, mut starts, mut step) = (None::<Expr>, None::<Expr>, None::<Expr>);
            let (mut null, mut plausible) = (None::<Expr>, None::<Expr>);
            let mut source = None::<LitStr>;
            attribute.parse_nested_meta(|meta| {
                let word = meta.path.require_ident()?.to_string();
                match word.as_str() {
                    "key" => name = meta.value()?.parse::<LitStr>()?.value(),
                    "unit" => unit = meta.value()?.parse::<LitStr>()?.value(),
                    "range" => range = Some(meta.value()?.parse()?),
                    "starts" => starts = Some(meta.value()?.parse()?),
                    "step" => step = Some(meta.value()?.parse()?),
                    "null" => null = Some(meta.value()?.parse()?),
                    "plausible" => plausible = Some(meta.value()?.parse()?),
                    "source" => source = Some(meta.value()?.parse()?),
                    _ => {
                        let known = "key, unit, range, starts, step, null, plausible or source";
                        return Err(meta.error(known));
                    }
                }
                Ok(())
            })?;
            let lacks = |what: &str| Error::new(attribute.span(), format!("{what} is missing"));
            let range = range.as_ref().or(key.limits()).ok_or_else(|| lacks("range"))?;
            let (min, max) = ends(range, &quote!(f64::INFINITY))?;
            let starts = starts.ok_or_else(|| lacks("starts"))?;
            let step = step.ok_or_else(|| lacks("step"))?;
            let null = null.map_or(quote!(None), |null| quote!(Some(#null)));
            let plausible = match (plausible, source) {
                (None, None) => quote!(None),
                (Some(range), Some(source)) => {
                    let (min, max) = ends(&range, &quote!(f64::INFINITY))?;
                    let ends = quote!(min: #min, max: #max, source: #source);
                    quote!(Some(::proto::effect::Plausible { #ends }))
                }
                (Some(_), None) => return Err(lacks("the source of the plausible range")),
                (None, Some(_)) => return Err(lacks("the plausible range")),
            };
            parameters.push(quote!(::proto::effect::Parameter {
                key: #name, unit: #unit, min: #min, max: #max, starts: &#starts, step: #step,
                null: #null, plausible: #plausible,
            }));
        }
    }
    Ok(parameters)
}
