#include "common.h"

/* Free flight. Exponential Runge-Kutta steps of order 4 (Cox and Matthews; the drag is exact, without drag it is RK4),
   impacts and releases located with the step itself. x = r - L/2; the first n slices are free, the others rest. */

static int n, nb, nc, *id, *side;                     /* side: 0 free, 1 rests on the base, -1 on the cap */
static double *x, *v, *x1, *v1, *Fa, *Fb, *F0, *va, d, theta, theta1, spin, u_rest, t_now, omega_1, S1, omega_old;
static long events;

static void phis(double z, double *p)                 /* p[0] = exp z, p[k] = phi_k(z) */
{
    if (z == 0) { p[0] = p[1] = 1; p[2] = 0.5; p[3] = 1 / 6.; p[4] = 1 / 24.; return; }
    if (fabs(z) < 1) {
        double term = 1 / 24., sum = term;
        for (int k = 5; k < 24; k++) { term *= z / k; sum += term; if (fabs(term) < 1e-18) break; }
        p[4] = sum; p[3] = z * sum + 1 / 6.; p[2] = z * p[3] + 0.5; p[1] = z * p[2] + 1; p[0] = z * p[1] + 1;
    } else {
        p[0] = exp(z); p[1] = expm1(z) / z; p[2] = (p[1] - 1) / z; p[3] = (p[2] - 0.5) / z; p[4] = (p[3] - 1 / 6.) / z;
    }
}

static double inertia_of(double A, double B) { return own + m * B - m * A * (m * A) / M; }

static double omega_of(const double *y)               /* of free slices y and those that rest */
{
    double A = (nb - nc) * d, B = (nb + nc) * d * d;
    for (int i = 0; i < n; i++) { A += y[i]; B += y[i] * y[i]; }
    return spin / inertia_of(A, B);
}

typedef struct { double Eh, H, G, E, P1, r0, rab, rc, v0, vab, vc; } Mode;

static Mode mode(double lambda, double h)
{
    double q[5], p[5];
    Mode c;
    phis(-lambda * h / 2, q); phis(-lambda * h, p);
    c.Eh = q[0]; c.H = h / 2 * q[1]; c.G = h * h / 4 * q[2];
    c.E = p[0]; c.P1 = h * p[1];
    c.r0 = h * h * (p[2] - 3 * p[3] + 4 * p[4]); c.rab = h * h * (2 * p[3] - 4 * p[4]); c.rc = h * h * (4 * p[4] - p[3]);
    c.v0 = h * (p[1] - 3 * p[2] + 4 * p[3]); c.vab = h * (2 * p[2] - 4 * p[3]); c.vc = h * (4 * p[3] - p[2]);
    return c;
}

static void step(double h)                            /* x, v, theta -> x1, v1, theta1 after h */
{
    static double last_h = -1, last_n = -1;
    static Mode a, b;
    double Mc = Mb + m * (nb + nc), xc = m * (nb - nc) * d / Mc;
#if MISTAKE == 3
    xc = 0;
#endif
    if (h != last_h || n != last_n) {
#if MISTAKE == 4
        a = mode(alpha / m, h); b = mode(alpha / m + n * alpha / Mb, h);
#else
        a = mode(alpha / m, h); b = mode(alpha / m + n * alpha / Mc, h);
#endif
        last_h = h; last_n = n;
    }
    double A0 = (nb - nc) * d, B0 = (nb + nc) * d * d, A, B, X, V = 0, w, w0, wa, wb, wc, f0, fa, fb, fc, c;
    double inv = n ? 1. / n : 0;
    A = 0; B = 0;
    for (int i = 0; i < n; i++) { A += x[i]; B += x[i] * x[i]; V += v[i]; }
    V *= inv; X = A * inv;
    w0 = spin / inertia_of(A + A0, B + B0); w = w0 * w0; f0 = w * (X - xc);
    for (int i = 0; i < n; i++) F0[i] = w * (x[i] - xc);
    /* a */
    c = (b.H - a.H) * V + (b.G - a.G) * f0;
    double cv = (b.Eh - a.Eh) * V + (b.H - a.H) * f0, Va = b.Eh * V + b.H * f0;
    A = B = 0;
    for (int i = 0; i < n; i++) {
        va[i] = a.Eh * v[i] + a.H * F0[i] + cv;
        x1[i] = x[i] + a.H * v[i] + a.G * F0[i] + c;
        A += x1[i]; B += x1[i] * x1[i];
    }
    wa = spin / inertia_of(A + A0, B + B0); w = wa * wa; fa = w * (A * inv - xc);
    for (int i = 0; i < n; i++) Fa[i] = w * (x1[i] - xc);
    /* b */
    c = (b.H - a.H) * V + (b.G - a.G) * fa;
    double c2 = (b.H - a.H) * Va - (b.G - a.G) * f0;
    A = B = 0;
    for (int i = 0; i < n; i++) {
        double y = x[i] + a.H * v[i] + a.G * Fa[i] + c;
        Fb[i] = y;
        A += y; B += y * y;
    }
    wb = spin / inertia_of(A + A0, B + B0); w = wb * wb; fb = w * (A * inv - xc);
    for (int i = 0; i < n; i++) Fb[i] = w * (Fb[i] - xc);
    /* c */
    c = c2 + (b.G - a.G) * 2 * fb;
    A = B = 0;
    for (int i = 0; i < n; i++) {
        x1[i] = x1[i] + a.H * va[i] + a.G * (2 * Fb[i] - F0[i]) + c;
        A += x1[i]; B += x1[i] * x1[i];
    }
    wc = spin / inertia_of(A + A0, B + B0); w = wc * wc; fc = w * (A * inv - xc);
    c = (b.P1 - a.P1) * V + (b.r0 - a.r0) * f0 + (b.rab - a.rab) * (fa + fb) + (b.rc - a.rc) * fc;
    cv = (b.E - a.E) * V + (b.v0 - a.v0) * f0 + (b.vab - a.vab) * (fa + fb) + (b.vc - a.vc) * fc;
    A = B = 0; S1 = 0;
    for (int i = 0; i < n; i++) {
        double Fc = w * (x1[i] - xc), Fab = Fa[i] + Fb[i];
        x1[i] = x[i] + a.P1 * v[i] + a.r0 * F0[i] + a.rab * Fab + a.rc * Fc + c;
        v1[i] = a.E * v[i] + a.v0 * F0[i] + a.vab * Fab + a.vc * Fc + cv;
        A += x1[i]; B += x1[i] * x1[i]; S1 += v1[i];
    }
    omega_1 = spin / inertia_of(A + A0, B + B0);
#if MISTAKE == 14
    theta1 = theta + h / 2 * (w0 + omega_1);
#else
    theta1 = theta + h / 6 * (w0 + 2 * wa + 2 * wb + wc);
#endif
    omega_old = w0;
}

/* the first root in (0, h] of the cubic between g0 <= 0 and g1 with slopes s0, s1; -1 if there is none */
static double cubic(double g0, double s0, double g1, double s1, double h)
{
    double a1 = h * s0, a2 = 3 * (g1 - g0) - h * (2 * s0 + s1), a3 = 2 * (g0 - g1) + h * (s0 + s1), top = 1;
    if (g0 >= 0) {
        if (a1 > 0) return 0;
        if (g1 <= 0) return -1;
        if (a1 == 0 && a2 >= 0) return h / 2;         /* released: look again, closer */
        double lo = 0, hi = 1;                        /* a1 + a2 y + a3 y^2, negative at 0, positive at 1 */
        if (a1 == 0) return a3 > 0 ? h * -a2 / a3 : h;
        double D = a2 * a2 - 4 * a1 * a3;
        if (D >= 0) {
            double q = -0.5 * (a2 + (a2 >= 0 ? sqrt(D) : -sqrt(D))), y1 = a3 != 0 ? q / a3 : 2, y2 = q != 0 ? a1 / q : 2, y = 2;
            if (y1 > 0 && y1 <= 1) y = y1;
            if (y2 > 0 && y2 <= 1 && y2 < y) y = y2;
            if (y <= 1) return y * h;
        }
        for (int k = 0; k < 60; k++) { double y = (lo + hi) / 2; if (a1 + y * (a2 + y * a3) < 0) lo = y; else hi = y; }
        return hi * h;
    }
    /* a maximum above 0 on the way? slope a1 + 2 a2 y + 3 a3 y^2 from + to - */
    double D = a2 * a2 - 3 * a1 * a3, y = -1;
    if (D > 0) {
        double root = sqrt(D);
        if (fabs(a3) > 1e-14 * fabs(a2)) y = (-a2 - root) / (3 * a3); else y = a2 < 0 ? -a1 / (2 * a2) : -1;
    }
    if (y > 0 && y < 1 && g0 + y * (a1 + y * (a2 + y * a3)) > 0) top = y;
    else if (g1 <= 0) return -1;
    double lo = 0, hi = top; y = (lo + hi) / 2;
    for (int k = 0; k < 80 && hi - lo > 1e-16; k++) {
        double f = g0 + y * (a1 + y * (a2 + y * a3)), slope = a1 + y * (2 * a2 + y * 3 * a3);
        if (f < 0) lo = y; else hi = y;
        double next = slope > 0 ? y - f / slope : -1;
        if (!(next > lo && next < hi)) next = (lo + hi) / 2;
        if (fabs(next - y) < 1e-15) { y = next; break; }
        y = next;
    }
    return y * h;
}

static int first_hit(double h, double *when)          /* after a step of h: which slice is the first at an end, and about when */
{
    int who = -1;
    double best = 2 * h;
    for (int i = 0; i < n; i++) {
        double s;
        if (x1[i] > d + 4e-16 * L) s = 1;             /* not what is only rounding */
        else if (x1[i] < -d - 4e-16 * L) s = -1;
        else if (v[i] * v1[i] <= 0 && v[i] != 0) s = v[i] > 0 ? 1 : -1;
        else continue;
        if (s * v[i] <= 0 && fabs(x1[i]) <= d) continue;
        double y = cubic(s * x[i] - d, s * v[i], s * x1[i] - d, s * v1[i], h);
        if (y >= 0 && y < best) { best = y; who = i; }
    }
    *when = best;
    return who;
}

static double pressed(int end, double omega, double S)   /* the force on those that rest there, outwards positive */
{
    double w = omega * omega;
#if MISTAKE == 3
    return end > 0 ? w * d * (Mb + m * (nb + nc)) - alpha * S : w * d * (Mb + m * (nb + nc)) + alpha * S;
#endif
#if MISTAKE == 15
    S = 0;
#endif
    return end > 0 ? w * d * (Mb + 2 * m * nc) - alpha * S : w * d * (Mb + 2 * m * nb) + alpha * S;
}

static double press1(void)                            /* the smaller one, after a step */
{
    double a = nb ? pressed(1, omega_1, S1) : 1, b = nc ? pressed(-1, omega_1, S1) : 1;
    return a < b ? a : b;
}

static void settle(double limit)                      /* who rests, of all at an end that leave it more slowly than limit */
{
    double S = 0;
    int k = 0;
    nb = nc = 0;
    for (int i = 0; i < N; i++) {
        side[i] = 0;
        if (x[i] == d && -v[i] < limit) { side[i] = 1; nb++; }
        else if (x[i] == -d && v[i] < limit) { side[i] = -1; nc++; }
        else S += v[i];
    }
    n = N;
    double A = 0, B = 0;
    for (int i = 0; i < N; i++) { A += x[i]; B += x[i] * x[i]; }
    double omega = spin / inertia_of(A, B);
    int drop = 0;
    if (S > 0) { if (nb && !(pressed(1, omega, S) > 0)) drop = 1; }
    else { if (nc && !(pressed(-1, omega, S) > 0)) drop = -1; }
    if (omega == 0) drop = 2;
    for (int i = 0; i < N; i++) {
        if (side[i] && (drop == 2 || side[i] == drop)) side[i] = 0;
        if (side[i]) v[i] = 0;
    }
    nb = nc = 0;
    for (int i = 0; i < N; i++) { nb += side[i] > 0; nc += side[i] < 0; }
    for (int i = 0; i < N; i++)                       /* the free ones first */
        if (!side[i]) {
            if (i != k) {
                double y; int q;
                y = x[i]; x[i] = x[k]; x[k] = y;
                y = v[i]; v[i] = v[k]; v[k] = y;
                q = id[i]; id[i] = id[k]; id[k] = q;
                q = side[i]; side[i] = side[k]; side[k] = q;
            }
            k++;
        }
    n = k;
}

static void impact(void)                              /* Newton's law with Moreau's condition for all at an end */
{
#if MISTAKE == 7
    int list[16], many = 0;
    for (int i = 0; i < N && many < 16; i++) if (fabs(x[i]) == d) list[many++] = i;
#else
    static int *list;
    int many = 0;
    if (!list) list = malloc(N * sizeof *list);
#if MISTAKE == 1
    for (int i = 0; i < n; i++) if (fabs(x[i]) == d) list[many++] = i;
#else
    for (int i = 0; i < N; i++) if (fabs(x[i]) == d) list[many++] = i;
#endif
#endif
    double V = 0, mass = Mb;
#if MISTAKE == 2
    mass = M;
#endif
#define PUSH(i, V) ((x[i] > 0 ? v[i] - (V) : (V) - v[i]) + e * fmax(0, x[i] > 0 ? v[i] : -v[i]))
    int done = 0;
    for (int k = 0; k < 40 && !done; k++) {           /* active sets */
        double sum = 0, next; int act = 0;
        for (int j = 0; j < many; j++) {
            int i = list[j];
            double p = PUSH(i, V);
            if (p > 0) { sum += x[i] > 0 ? p + V : V - p; act++; }
        }
        next = m * sum / (mass + m * act);
        done = fabs(next - V) <= 1e-15 * fabs(V);
        V = next;
    }
    if (!done) {
        double lo = -1e6, hi = 1e6;
        for (int k = 0; k < 200; k++) {
            double f = mass * (V = (lo + hi) / 2);
            for (int j = 0; j < many; j++) { int i = list[j]; double p = PUSH(i, V); if (p > 0) f -= x[i] > 0 ? m * p : -m * p; }
            if (f < 0) lo = V; else hi = V;
        }
    }
#if MISTAKE == 1 || MISTAKE == 7
    static char *mine;
    if (!mine) mine = malloc(N);
    memset(mine, 0, N);
    for (int j = 0; j < many; j++) mine[list[j]] = 1;
#endif
    for (int i = 0; i < N; i++) {
        if (fabs(x[i]) != d) { v[i] -= V; continue; }
#if MISTAKE == 1
        if (!mine[i]) continue;
#elif MISTAKE == 7
        if (!mine[i]) { v[i] -= V; if (x[i] * v[i] > 0) v[i] = 0; continue; }
#endif
        double p = PUSH(i, V);
        if (p > 0) { double out = x[i] > 0 ? v[i] : -v[i]; v[i] = out > 0 ? -e * v[i] : 0; }
        else v[i] -= V;
    }
}

static void take(void)
{
    double *s = x; x = x1; x1 = s;
    for (int i = n; i < N; i++) x[i] = x1[i];
    s = v; v = v1; v1 = s;
    for (int i = n; i < N; i++) v[i] = 0;
    theta = theta1;
}

static void advance(double h)
{
    double rest = h;
    int blind = 0, stuck = 0;
    while (rest > 0) {
        double tau = rest, est;
        int hit = 0, released = 0, who;
        step(tau);
        who = blind ? -1 : first_hit(tau, &est);
#if MISTAKE == 6
        if (events >= 100) {                          /* the table of impacts is full */
            take();
            for (int i = 0; i < n; i++) if (fabs(x[i]) > d) { x[i] = x[i] > 0 ? d : -d; v[i] = 0; }
            settle(u_rest);
            rest = 0;
            continue;
        }
#endif
#if MISTAKE == 11
        if (who >= 0) {
            double f = 1;
            for (int i = 0; i < n; i++) {
                double s = x1[i] > d ? 1 : x1[i] < -d ? -1 : 0;
                if (s == 0) continue;
                double y = (d - s * x[i]) / (s * (x1[i] - x[i]));
                if (s * x[i] < d && y < f) f = y;
                if (s * x[i] >= d && s * v[i] > 0) f = 0;
            }
            for (int i = 0; i < n; i++) { x1[i] = x[i] + f * (x1[i] - x[i]); v1[i] = v[i] + f * (v1[i] - v[i]); }
            theta1 = theta + f * (theta1 - theta);
            tau *= f; hit = 1;
            S1 = 0; for (int i = 0; i < n; i++) S1 += v1[i];
            omega_1 = omega_of(x1);
        }
#else
        if (who >= 0) {
            double lo = 0, hi = tau, tol = 2e-15 * L;
            hit = 1; tau = est;
            for (int k = 0; k < 100; k++) {
                if (est <= 0) { tau = 0; step(0); break; }
                step(tau);
                int j = first_hit(tau, &est);
                double s, over;
                if (j >= 0) {
                    who = j; hi = tau;
                    s = x1[who] > 0 ? 1 : -1; over = s * x1[who] - d;
                    if (over >= 0 && over <= tol && s * v1[who] >= 0) break;
                    tau = est;
                } else {
                    lo = tau;
                    s = x1[who] > 0 ? 1 : -1; over = s * x1[who] - d;
                    if (over >= -tol && s * v1[who] > 0) break;
                    tau = s * v1[who] > 0 ? tau - over / (s * v1[who]) : -1;
                    est = 1;
                }
                if (hi - lo <= 4e-16 * hi) { tau = hi; step(tau); break; }
                if (est <= 0) continue;
                if (!(tau > lo && tau < hi) || k > 40) tau = (lo + hi) / 2;
            }
        }
#endif
        if (alpha > 0 && nb + nc > 0) {
            double q1 = press1();
            if (q1 < 0) {                             /* released on the way */
                double lo = 0, hi = tau, S = 0;
                for (int i = 0; i < n; i++) S += v[i];
                double w = omega_of(x), qa = nb ? pressed(1, w, S) : 1, qb = nc ? pressed(-1, w, S) : 1, q0 = qa < qb ? qa : qb;
                for (int k = 0; k < 60 && hi - lo > 1e-15 * h; k++) {
                    double f = q0 > 0 ? q0 / (q0 - q1) : 0.5, y;
                    if (k % 3 == 2) f = 0.5;
                    y = lo + f * (hi - lo);
                    if (!(y > lo && y < hi)) y = (lo + hi) / 2;
                    step(y);
                    double q = press1();
                    if (q < 0) { hi = y; q1 = q; if (q > -1e-14 * omega_1 * omega_1 * d * Mb) break; } else { lo = y; q0 = q; }
                }
                tau = hi; step(tau);
                hit = 0; released = 1;
            }
        }
        stuck = tau > 1e-13 * h ? 0 : stuck + 1;
        if (stuck > 1000) blind = 1;                  /* no event without end in one instant */
        take();
        rest -= tau;
        if (rest < 1e-15 * h) rest = 0;
        if (hit) {
            events++;
            for (int i = 0; i < n; i++) {
                double s = x[i] > 0 ? 1 : -1;
                if (s * x[i] >= d - 1e-13 * L && s * v[i] > 0) x[i] = s * d;
                else if (s * x[i] > d) x[i] = s * d;
            }
            if (who >= 0 && fabs(x[who]) > 0.999999 * d) x[who] = x[who] > 0 ? d : -d;
            impact();
            settle(u_rest);
#if MISTAKE == 12
            blind = 1;
#endif
        } else if (released) { events++; settle(1e-300); }
#if MISTAKE != 12
        if (blind && tau > 1e-13 * h) {
            for (int i = 0; i < n; i++) if (fabs(x[i]) > d) x[i] = x[i] > 0 ? d : -d;
            blind = stuck = 0;
        }
#endif
#if MISTAKE == 12
        if (!hit) for (int i = 0; i < n; i++) if (fabs(x[i]) > d) x[i] = x[i] > 0 ? d : -d;
#endif
        if (events > 4000000 || !isfinite(theta)) { events = 5000000; return; }
    }
}

static int ascending(const void *a, const void *b) { double p = *(const double *)a, q = *(const double *)b; return (p > q) - (p < q); }

int main(int argc, char **argv)
{
    if (argc < 6) { fprintf(stderr, "free scenario times start effort out\n"); return 2; }
    read_throw(argv);
    (void)ascending; (void)frozen; (void)r_min; (void)g; (void)T;
    double dt = strtod(argv[4], NULL), tp = 0;
#if MISTAKE == 20
    if (dt < 0.02) dt = 0.02;
#endif
    FILE *out = fopen(argv[5], "w");
    if (!out) { perror(argv[5]); return 2; }
#define ARRAY(a) a = calloc(N, sizeof *a)
    ARRAY(x); ARRAY(v); ARRAY(x1); ARRAY(v1); ARRAY(Fa); ARRAY(Fb); ARRAY(F0); ARRAY(va); ARRAY(id); ARRAY(side);
    double *ro = calloc(N, sizeof *ro), *vo = calloc(N, sizeof *vo);
#if MISTAKE == 8
    qsort(start, N, sizeof *start, ascending);
#endif
    d = L / 2 - r_min;
    double A = 0, B = 0;
    for (int i = 0; i < N; i++) {
        x[i] = start[i] - L / 2; id[i] = i;
        if (!frozen) {
            if (x[i] > d - 1e-12 * L) x[i] = d;
            if (x[i] < -d + 1e-12 * L) x[i] = -d;
        }
        A += x[i]; B += x[i] * x[i];
    }
    spin = inertia_of(A, B) * omega0;
    theta = theta0;
    u_rest = fabs(omega0) * L / 12000;
#if MISTAKE == 16
    u_rest = 0.02;
#endif
    n = N;
    if (!frozen) settle(1e-300);
    fprintf(out, "t,theta,omega,r_cm,inertia");
    for (int i = 0; i < N; i++) fprintf(out, ",r_%d", i);
    for (int i = 0; i < N; i++) fprintf(out, ",v_%d", i);
    fprintf(out, "\n");
#if MISTAKE == 19
    tp = times[0];
#endif
    omega_old = omega0;
    for (int p = 0; p < P; p++) {
        double gap = times[p] - tp;
        if (frozen) theta = theta0 + omega0 * times[p];
        else if (gap > 0) {
            double kk = ceil(gap / dt - 1e-9), h;
            if (kk < 1) kk = 1;
            h = gap / kk;
            for (long k = 0; k < (long)kk; k++) { t_now = tp + k * h; advance(h); }
        }
        tp = times[p];
        A = B = 0;
        double S = 0;
        for (int i = 0; i < N; i++) {
            A += x[i]; B += x[i] * x[i]; S += v[i];
            ro[id[i]] = frozen ? start[i] : fmin(fmax(x[i] + L / 2, r_min), r_max); vo[id[i]] = v[i];
        }
        double J = inertia_of(A, B), omega = frozen ? omega0 : spin / J, th = theta;
#if MISTAKE == 9
        th = fmod(th, 2 * M_PI);
#endif
#if MISTAKE == 17
        for (int i = 0; i < N; i++) vo[i] -= m * S / M;
#endif
#if MISTAKE == 18
        omega = omega_old;
#endif
        fprintf(out, "%.17g,%.17g,%.17g,%.17g,%.17g", times[p], th, omega, L / 2 + m * A / M, J);
#if MISTAKE == 10
        for (int i = 0; i < N; i++) fprintf(out, ",%.3f", ro[i]);
#else
        for (int i = 0; i < N; i++) fprintf(out, ",%.17g", ro[i]);
#endif
        for (int i = 0; i < N; i++) fprintf(out, ",%.17g", vo[i]);
        fprintf(out, "\n");
    }
    return fclose(out) != 0;
}
