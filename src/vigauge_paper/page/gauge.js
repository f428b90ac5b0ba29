"use strict";
// The covariance of an estimate in any gauge, as vigauge.covariance computes it: Eqs. (12) and (14).
// Matrices are Float64Array, row by row. The motion has n = 9N parameters, the gauge d = 4: yaw, x, y, z.
const gaugeMath = (() => {
  const d = 4;

  const matrix = (rows, columns) => new Float64Array(rows * columns);

  function product(A, B, n, m, k) {
    const out = matrix(n, k);
    for (let i = 0; i < n; i++)
      for (let j = 0; j < m; j++) {
        const a = A[i * m + j];
        if (a !== 0) for (let c = 0; c < k; c++) out[i * k + c] += a * B[j * k + c];
      }
    return out;
  }

  function transposed(A, n, m) {
    const out = matrix(m, n);
    for (let i = 0; i < n; i++) for (let j = 0; j < m; j++) out[j * n + i] = A[i * m + j];
    return out;
  }

  // Gauss and Jordan, with row pivots.
  function inverse(A, n) {
    const a = Float64Array.from(A);
    const out = matrix(n, n);
    for (let i = 0; i < n; i++) out[i * n + i] = 1;
    for (let k = 0; k < n; k++) {
      let best = k;
      for (let i = k + 1; i < n; i++) if (Math.abs(a[i * n + k]) > Math.abs(a[best * n + k])) best = i;
      for (const M of [a, out])
        for (let j = 0; j < n; j++) [M[k * n + j], M[best * n + j]] = [M[best * n + j], M[k * n + j]];
      const pivot = a[k * n + k];
      for (const M of [a, out]) for (let j = 0; j < n; j++) M[k * n + j] /= pivot;
      for (let i = 0; i < n; i++) {
        const factor = i === k ? 0 : a[i * n + k];
        if (factor !== 0)
          for (const M of [a, out]) for (let j = 0; j < n; j++) M[i * n + j] -= factor * M[k * n + j];
      }
    }
    return out;
  }

  // Lower triangle L with L L^T = A; NaN where A is not positive definite.
  function cholesky(A, n) {
    const L = matrix(n, n);
    for (let i = 0; i < n; i++)
      for (let j = 0; j <= i; j++) {
        let sum = A[i * n + j];
        for (let k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
        L[i * n + j] = i === j ? Math.sqrt(sum) : sum / L[j * n + j];
      }
    return L;
  }

  function unpacked(text) {
    const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    return new Float64Array(bytes.buffer);
  }

  function symmetric(lower, n) {
    const out = matrix(n, n);
    for (let i = 0, k = 0; i < n; i++)
      for (let j = 0; j <= i; j++, k++) out[i * n + j] = out[j * n + i] = lower[k];
    return out;
  }

  // An estimate as vigauge_paper.page.explorer ships it.
  function estimate(data) {
    const N = data.keyframes;
    const n = 9 * N;
    const arrays = Object.fromEntries(Object.entries(data.arrays).map(([key, text]) => [key, unpacked(text)]));
    arrays.G = symmetric(arrays.G, n);
    arrays.G_noisier = symmetric(arrays.G_noisier, n);
    return { ...data, N, n, ...arrays };
  }

  // V (n, 4) of a gauge that constrains the motion alone.
  function normal(e, gauge) {
    const V = matrix(e.n, d);
    if (gauge.kind === "fix" || gauge.kind === "prior") {
      [0, 1, 2, 3 * e.N + 2].forEach((row, column) => (V[row * d + column] = 1));
    } else if (gauge.kind === "motion") {
      V.set(e.U);
    } else {
      for (let k = 0; k < e.N; k++) {
        const weight = gauge.kind === "centroid" ? 1 / e.N : Number(k === gauge.keyframe);
        for (let axis = 0; axis < 3; axis++) V[(3 * k + axis) * d + axis] = weight;
        // The first rotation has the total increment, which turns the keyframe by J_l of its change.
        for (let axis = 0; axis < 3; axis++)
          V[(3 * e.N + 3 * k + axis) * d + 3] = weight * (k === 0 ? e.left_jacobian[6 + axis] : Number(axis === 2));
      }
    }
    return V;
  }

  // Information of a prior by what its weight multiplies.
  const information = (gauge) => (gauge.reading === "residual" ? gauge.weight ** 2 : gauge.weight);

  // Products of a gauge with G, and W = U (V^T U)^-1. With the landmarks, V = U, they come with the data.
  function products(e, gauge, ending) {
    const G = e["G" + ending];
    if (gauge.kind === "free") {
      return { G, GV: e["G_U" + ending], VGV: e["U_G_U" + ending], W: product(e.U, inverse(e.U_U, d), e.n, d, d) };
    }
    const V = normal(e, gauge);
    const Vt = transposed(V, e.n, d);
    const GV = product(G, V, e.n, e.n, d);
    const W = product(e.U, inverse(product(Vt, e.U, d, e.n, d), d), e.n, d, d);
    return { G, V, Vt, GV, VGV: product(Vt, GV, d, e.n, d), W };
  }

  // Q G Q^T; a prior adds what it leaves open along the orbit: W (1 / information) W^T.
  function covariance(e, gauge, ending = "") {
    const { G, GV, VGV, W } = products(e, gauge, ending);
    const n = e.n;
    const A = Float64Array.from(GV);
    const half = product(W, VGV, n, d, d);
    for (let i = 0; i < A.length; i++) A[i] -= 0.5 * half[i];
    const open = gauge.kind === "prior" ? 1 / information(gauge) : 0;
    const out = matrix(n, n);
    for (let i = 0; i < n; i++)
      for (let j = 0; j <= i; j++) {
        let sum = G[i * n + j];
        for (let c = 0; c < d; c++)
          sum -= A[i * d + c] * W[j * d + c] + W[i * d + c] * A[j * d + c] - open * W[i * d + c] * W[j * d + c];
        out[i * n + j] = out[j * n + i] = sum;
      }
    return out;
  }

  // Traces of position (m^2), rotation (rad^2) and velocity (m^2/s^2).
  function traces(e, C) {
    return [0, 1, 2].map((kind) => {
      let sum = 0;
      for (let i = 3 * e.N * kind; i < 3 * e.N * (kind + 1); i++) sum += C[i * e.n + i];
      return sum;
    });
  }

  // (6, 6) covariance of keyframe j's pose in keyframe i's frame: position (m), rotation (rad).
  function relative(e, C, i, j) {
    const R = (k, r, c) => e.R_WB[9 * k + 3 * r + c];
    const ray = [0, 1, 2].map((axis) => e.p_W[3 * j + axis] - e.p_W[3 * i + axis]);
    const hat = [0, -ray[2], ray[1], ray[2], 0, -ray[0], -ray[1], ray[0], 0];
    const J = matrix(6, 12);
    for (let r = 0; r < 3; r++)
      for (let c = 0; c < 3; c++) {
        const toBody = R(i, c, r);
        J[r * 12 + c] = J[(3 + r) * 12 + 3 + c] = -toBody;
        J[r * 12 + 6 + c] = J[(3 + r) * 12 + 9 + c] = toBody;
        for (let m = 0; m < 3; m++) J[r * 12 + 3 + c] += R(i, m, r) * hat[3 * m + c];
      }
    [i, j].forEach((k, side) => {
      if (k !== 0) return;
      for (let r = 0; r < 6; r++) {
        const row = [0, 1, 2].map((c) => J[r * 12 + 6 * side + 3 + c]);
        for (let c = 0; c < 3; c++)
          J[r * 12 + 6 * side + 3 + c] = row[0] * e.left_jacobian[c] + row[1] * e.left_jacobian[3 + c] + row[2] * e.left_jacobian[6 + c];
      }
    });
    const index = [i, j].flatMap((k) => [0, 1, 2, 3, 4, 5].map((c) => (c < 3 ? 3 * k + c : 3 * e.N + 3 * k + c - 3)));
    const part = matrix(12, 12);
    index.forEach((row, a) => index.forEach((column, b) => (part[a * 12 + b] = C[row * e.n + column])));
    return product(product(J, part, 6, 12, 12), transposed(J, 6, 12), 6, 12, 6);
  }

  // NEES of the true error, taken to the gauge, with its degrees of freedom; and the logarithm of the
  // product of the covariance's eigenvalues that are not zero. To be inverted, the covariance C of a gauge
  // that constrains the motion is raised along V, where it is zero. A prior adds its information there, and
  // so only to the logarithm.
  function consistency(e, gauge, ending = "") {
    if (gauge.kind === "prior") {
      const held = consistency(e, { kind: "fix" }, ending);
      return { ...held, logDet: held.logDet - d * Math.log(information(gauge)) };
    }
    const { V, Vt, W } = products(e, gauge, ending);
    const n = e.n;
    const free = gauge.kind === "free";
    const raised = covariance(e, gauge, ending);
    const dof = free ? n : n - d;
    let logDet = 0;
    if (!free) {
      const scale = raised.reduce((sum, value, k) => (k % (n + 1) === 0 ? sum + value / n : sum), 0);
      const P = product(product(V, inverse(product(Vt, V, d, n, d), d), n, d, d), Vt, n, d, n);
      for (let i = 0; i < raised.length; i++) raised[i] += scale * P[i];
      logDet = -d * Math.log(scale);
    }
    const sigma = Float64Array.from({ length: n }, (_, i) => Math.sqrt(raised[i * n + i]));
    for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) raised[i * n + j] /= sigma[i] * sigma[j];
    const L = cholesky(raised, n);
    for (let i = 0; i < n; i++) logDet += 2 * Math.log(L[i * n + i] * sigma[i]);
    // The free gauge of the paper asks for the errors of the landmarks, which a recording does not have.
    const along = free ? e.U_error && product(inverse(e.U_U, d), e.U_error, d, d, 1) : product(Vt, e.error, d, n, 1);
    if (!along) return { nees: NaN, dof, logDet };
    const back = product(free ? e.U : W, along, n, d, 1);
    const whitened = matrix(n, 1);
    let nees = 0;
    for (let i = 0; i < n; i++) {
      let sum = (e.error[i] - back[i]) / sigma[i];
      for (let k = 0; k < i; k++) sum -= L[i * n + k] * whitened[k];
      whitened[i] = sum / L[i * n + i];
      nees += whitened[i] ** 2;
    }
    return { nees, dof, logDet };
  }

  // What Q does to the direction across the orbit (Fig. 8): how far it moves the estimate along the orbit,
  // yaw (rad) and shift (m).
  function slope(e, gauge) {
    const along =
      gauge.kind === "free"
        ? product(inverse(e.U_U, d), e.U_direction, d, d, 1)
        : (({ Vt }) =>
            product(inverse(product(Vt, e.U, d, e.n, d), d), product(Vt, e.direction, d, e.n, 1), d, d, 1))(
            products(e, gauge, ""),
          );
    return along.map((value) => -value);
  }

  return { estimate, covariance, traces, relative, consistency, slope, normal, information };
})();
