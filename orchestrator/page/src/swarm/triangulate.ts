/** Corners of triangles that cover a simple polygon, three indices each: ear clipping, for polygons of some tens of corners. */
export function triangulate(x: number[], y: number[]): number[] {
  const n = Math.min(x.length, y.length);
  if (n < 3) return [];
  let area = 0;
  for (let i = 0, j = n - 1; i < n; j = i++) area += x[j] * y[i] - x[i] * y[j];
  const left = Array.from({ length: n }, (_, i) => (area > 0 ? i : n - 1 - i));
  const turn = (a: number, b: number, c: number): number => (x[b] - x[a]) * (y[c] - y[a]) - (y[b] - y[a]) * (x[c] - x[a]);
  const triangles: number[] = [];
  while (left.length > 3) {
    const ear = left.findIndex((b, i) => {
      const a = left[(i + left.length - 1) % left.length];
      const c = left[(i + 1) % left.length];
      if (turn(a, b, c) <= 0) return false;
      return left.every((p) => p === a || p === b || p === c || turn(a, b, p) < 0 || turn(b, c, p) < 0 || turn(c, a, p) < 0);
    });
    // A polygon that crosses itself may have no ear: cut off any corner rather than none.
    const at = ear < 0 ? 0 : ear;
    triangles.push(left[(at + left.length - 1) % left.length], left[at], left[(at + 1) % left.length]);
    left.splice(at, 1);
  }
  triangles.push(...left);
  return triangles;
}
