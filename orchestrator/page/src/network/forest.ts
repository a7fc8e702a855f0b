import { NO_MOTE } from "../source/frame.ts";

/** A mote and those that have it as their preferred parent. */
export interface TreeNode {
  mote: number;
  /** The parent is a descendant: a transient loop, cut here. */
  loop: boolean;
  children: TreeNode[];
}

/**
 * Trees of preferred parents. Motes without parent and without children are listed apart. Each transient loop is cut at its mote of
 * least number, which becomes the root of its tree.
 */
export function forest(parent: Uint32Array): { roots: TreeNode[]; alone: number[] } {
  const count = parent.length;
  const nodes: TreeNode[] = Array.from({ length: count }, (_, mote) => ({ mote, loop: false, children: [] }));
  // 0: not visited, 1: on the way up that is being walked, 2: known to end at a root.
  const visited = new Uint8Array(count);
  for (let start = 0; start < count; start++) {
    const way: number[] = [];
    let at = start;
    while (at < count && visited[at] === 0) {
      visited[at] = 1;
      way.push(at);
      at = parent[at];
    }
    if (at < count && visited[at] === 1) nodes[Math.min(...way.slice(way.indexOf(at)))].loop = true;
    for (const mote of way) visited[mote] = 2;
  }
  const roots: TreeNode[] = [];
  const alone: number[] = [];
  const tops: number[] = [];
  for (let mote = 0; mote < count; mote++) {
    if (nodes[mote].loop || parent[mote] === NO_MOTE || parent[mote] >= count) tops.push(mote);
    else nodes[parent[mote]].children.push(nodes[mote]);
  }
  for (const mote of tops) {
    if (nodes[mote].children.length > 0) roots.push(nodes[mote]);
    else alone.push(mote);
  }
  return { roots, alone };
}
