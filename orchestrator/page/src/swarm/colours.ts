/** A colour as the bytes R, G, B, A of a little-endian number, the form that vertex buffers take. */
export type Packed = number;

export function pack(hex: string, alpha = 1): Packed {
  const rgb = Number.parseInt(hex.slice(1), 16);
  return (((rgb >> 16) & 255) | (rgb & 0xff00) | ((rgb & 255) << 16) | (Math.round(alpha * 255) << 24)) >>> 0;
}

/** The same colour with another opacity. */
export function withAlpha(colour: Packed, alpha: number): Packed {
  return ((colour & 0xffffff) | (Math.round(alpha * 255) << 24)) >>> 0;
}

const cssCache = new Map<Packed, string>();

export function css(colour: Packed): string {
  let text = cssCache.get(colour);
  if (text === undefined) {
    const alpha = (colour >>> 24) / 255;
    text = `rgba(${colour & 255},${(colour >> 8) & 255},${(colour >> 16) & 255},${+alpha.toFixed(3)})`;
    if (cssCache.size > 4096) cssCache.clear();
    cssCache.set(colour, text);
  }
  return text;
}

/** Okabe and Ito's colours, which people with colour-blindness can tell apart. */
export const OKABE_ITO = {
  orange: "#e69f00",
  sky: "#56b4e9",
  green: "#009e73",
  yellow: "#f0e442",
  blue: "#0072b2",
  vermilion: "#d55e00",
  purple: "#cc79a7",
} as const;

/** Colours for categories, in the order in which they are handed out. */
export const CATEGORIES: string[] = ["blue", "orange", "green", "purple", "sky", "vermilion", "yellow"].map(
  (name) => OKABE_ITO[name as keyof typeof OKABE_ITO],
);

const VIRIDIS = ["#440154", "#482878", "#3e4a89", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];

/** 256 steps of viridis. The end that would vanish against the background is left out. */
export function viridis(dark: boolean, alpha = 1): Uint32Array {
  const [from, to] = dark ? [0.25, 1] : [0, 0.9];
  const table = new Uint32Array(256);
  for (let i = 0; i < 256; i++) {
    const at = (from + ((to - from) * i) / 255) * (VIRIDIS.length - 1);
    const low = Math.min(VIRIDIS.length - 2, Math.floor(at));
    table[i] = mix(pack(VIRIDIS[low], alpha), pack(VIRIDIS[low + 1], alpha), at - low);
  }
  return table;
}

/** Colour between two others. */
export function mix(a: Packed, b: Packed, share: number): Packed {
  let mixed = 0;
  for (let shift = 0; shift < 32; shift += 8) {
    const from = (a >>> shift) & 255;
    mixed |= Math.round(from + (((b >>> shift) & 255) - from) * share) << shift;
  }
  return mixed >>> 0;
}

/** Index into a table of 256 colours. */
export function shade(value: number, least: number, most: number): number {
  if (!(most > least)) return 128;
  return Math.max(0, Math.min(255, Math.round((255 * (value - least)) / (most - least))));
}

/** Colours of one theme. */
export interface Theme {
  dark: boolean;
  background: string;
  text: string;
  faintText: string;
  grid: Packed;
  wall: Packed;
  obstacle: Packed;
  obstacleFill: Packed;
  hidden: Packed;
  estimated: Packed;
  foliage: Packed;
  dead: Packed;
  missed: Packed;
  ghost: Packed;
  selected: Packed;
  scale: Uint32Array;
  linkScale: Uint32Array;
  categories: Packed[];
}

/** The colour of what is neither one way nor the other. */
export function neutral(dark: boolean): string {
  return dark ? "#6b7480" : "#b4bac1";
}

export function theme(dark: boolean): Theme {
  const text = dark ? "#e6e8eb" : "#1b1f24";
  return {
    dark,
    background: dark ? "#14171b" : "#ffffff",
    text,
    faintText: dark ? "#9aa4af" : "#5b6570",
    grid: pack(dark ? "#ffffff" : "#000000", dark ? 0.08 : 0.07),
    wall: pack(dark ? "#c9d1d9" : "#30363d"),
    obstacle: pack(dark ? "#9aa4af" : "#59636e"),
    obstacleFill: pack(dark ? "#9aa4af" : "#59636e", 0.3),
    hidden: pack(OKABE_ITO.vermilion),
    estimated: pack(dark ? "#2fc39a" : OKABE_ITO.green),
    foliage: pack(OKABE_ITO.green, dark ? 0.3 : 0.22),
    dead: pack(dark ? "#8b949e" : "#6e7781"),
    missed: pack(OKABE_ITO.vermilion, 0.6),
    ghost: pack(OKABE_ITO.purple),
    selected: pack(text),
    scale: viridis(dark),
    linkScale: viridis(dark, 0.6),
    categories: CATEGORIES.map((colour) => pack(dark && colour === OKABE_ITO.blue ? "#4aa3e0" : colour)),
  };
}
