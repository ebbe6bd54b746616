#include "common.h"

/* Eq. 8. Velocity Verlet with the drag exact (without drag it is velocity Verlet), order 2, on a uniform grid; impacts and
   releases located with the step itself; what lies between two steps comes from cubic Hermite polynomials. */

static int *side;                                     /* 0 free, 1 rests on the base, -1 on the cap */
static double *r, *v, *r2, *v2, *acc, theta, theta2, omega, omega2, J0, spin, rcm, rcm2, u_rest, S, S2, af, vf;
static int n_free;
static long events;

static void phi(double z, double *p)                  /* exp z, phi_1, phi_2 */
{
    if (z == 0) { p[0] = p[1] = 1; p[2] = 0.5; return; }
    if (fabs(z) < 0.5) {
        double term = 0.5, sum = term;
        for (int k = 3; k < 20; k++) { term *= z / k; sum += term; if (fabs(term) < 1e-18) break; }
        p[2] = sum; p[1] = z * sum + 1; p[0] = z * p[1] + 1;
    } else { p[0] = exp(z); p[1] = expm1(z) / z; p[2] = (p[1] - 1) / z; }
}

typedef struct { double E1, E2, p1, p2, q1, q2, h; } Flow;   /* of the deviations from the mean, and of the mean */

static Flow flow(double h)
{
    Flow f;
    double a[3], b[3], k1 = alpha / m, k2 = alpha / m * (1 - m * n_free / M);
#if MISTAKE == 39
    static double rate = -1;
    if (rate < 0) rate = k2;
    k2 = rate;
#endif
#if MISTAKE == 23
    k2 = k1;
#endif
#if MISTAKE == 24
    k2 = n_free ? alpha / m * (1 - (double)n_free / N) : 0;
#endif
    phi(-k1 * h, a); phi(-k2 * h, b);
    f.E1 = a[0]; f.E2 = b[0]; f.p1 = h * a[1]; f.p2 = h * b[1]; f.q1 = h * h * a[2]; f.q2 = h * h * b[2]; f.h = h;
    return f;
}

static double where(const Flow *f, int i) { return r[i] + f->p1 * (v[i] - vf) + f->p2 * vf + f->q1 * (acc[i] - af) + f->q2 * af; }
static double speed(const Flow *f, int i) { return f->E1 * (v[i] - vf) + f->E2 * vf + f->p1 * (acc[i] - af) + f->p2 * af; }

static double inertia(const double *y, double *centre)
{
    double sum = 0, q = 0, c;
    for (int i = 0; i < N; i++) sum += y[i];
    c = (m * sum + Mb * L / 2) / M;
    for (int i = 0; i < N; i++) q += (y[i] - c) * (y[i] - c);
    *centre = c;
#if MISTAKE == 37
    return own + m * q;
#else
    return own + m * q + Mb * (L / 2 - c) * (L / 2 - c);
#endif
}

static double t_piece;
static double weight(double th)
{
#if MISTAKE == 22
    (void)th;
    return g * cos(theta0 + omega0 * t_piece);
#else
    return g * cos(th);
#endif
}

static void begin(void)                               /* what a piece of the flight begins with */
{
    omega = spin / inertia(r, &rcm);
    double sum = 0, W = weight(theta);
    S = 0; n_free = 0;
    for (int i = 0; i < N; i++) {
        acc[i] = omega * omega * (r[i] - rcm) + W;
        if (!side[i]) { n_free++; S += v[i]; sum += acc[i]; }
    }
    vf = n_free ? S / n_free : 0;
    af = n_free ? sum / n_free : 0;
}

static double pressing(int end, double w, double centre, double th, double sum)
{
    double reference = alpha * sum / M;
#if MISTAKE == 23
    reference = 0;
#endif
#if MISTAKE == 24
    reference = alpha / m * sum / N;
#endif
    return end * (w * w * ((end > 0 ? r_max : r_min) - centre) + weight(th) + reference);
}

static int on_base, on_cap;

static double press2(void)
{
    double a = on_base ? pressing(1, omega2, rcm2, theta2, S2) : 1, b = on_cap ? pressing(-1, omega2, rcm2, theta2, S2) : 1;
#if MISTAKE == 33
    b = 1;
#endif
    return a < b ? a : b;
}

static void settle(double limit)
{
    double sum = 0, c, w;
    for (int i = 0; i < N; i++) {
        side[i] = 0;
        if (r[i] == r_max && -v[i] < limit) side[i] = 1;
        else if (r[i] == r_min && v[i] < limit) side[i] = -1;
        else sum += v[i];
    }
    w = spin / inertia(r, &c);
    double up = pressing(1, w, c, theta, sum), down = pressing(-1, w, c, theta, sum);
#if MISTAKE == 33
    down = 1;
#endif
    on_base = on_cap = 0;
    for (int i = 0; i < N; i++) {
        if (side[i] > 0 && !(up > 0)) side[i] = 0;
        if (side[i] < 0 && !(down > 0)) side[i] = 0;
        if (side[i]) v[i] = 0;
        on_base += side[i] > 0; on_cap += side[i] < 0;
    }
}

static void trial(double h)                           /* the step: r2, v2, theta2 after h */
{
    Flow f = flow(h);
    for (int i = 0; i < N; i++) r2[i] = side[i] ? r[i] : where(&f, i);
    omega2 = spin / inertia(r2, &rcm2);
#if MISTAKE == 36
    theta2 = theta + h * omega;
#else
    theta2 = theta + h / 2 * (omega + omega2);
#endif
    double W = weight(theta2), sum = 0, k1 = f.q1 / h, k2 = f.q2 / h;
    for (int i = 0; i < N; i++) {
        v2[i] = omega2 * omega2 * (r2[i] - rcm2) + W;
        if (!side[i]) sum += v2[i];
    }
    double a2f = n_free ? sum / n_free : 0;
    S2 = 0;
    for (int i = 0; i < N; i++) {
        if (side[i]) { v2[i] = 0; continue; }
        v2[i] = speed(&f, i) + (h > 0 ? k1 * (v2[i] - a2f - acc[i] + af) + k2 * (a2f - af) : 0);
        S2 += v2[i];
    }
}

static double sought(int i, double s, double lo, double hi, int of_speed)   /* g(lo) <= 0 < g(hi), g = s (r - end) or -s v */
{
    double end = s > 0 ? r_max : r_min, y = (lo + hi) / 2;
    for (int k = 0; k < 100; k++) {
        Flow f = flow(y);
        double u = speed(&f, i), gy = of_speed ? -s * u : s * (where(&f, i) - end), slope = of_speed ? 0 : s * u, next = -1;
        if (gy <= 0) lo = y; else hi = y;
        if (hi - lo <= 2e-16 * hi) break;
        if (slope > 0) next = y - gy / slope;
        if (next == y) break;
        if (!(next > lo && next < hi)) {
            if (slope > 0 && (next == lo || next == hi)) return next;
            next = (lo + hi) / 2;
        }
        y = next;
        if (of_speed && hi - lo < 1e-6 * hi) break;
    }
    return of_speed ? hi : y;
}

static int earliest(double h, double *when)
{
    Flow f = flow(h), b = f;
    int who = -1;
    double best = h;
    for (int i = 0; i < N; i++) {
        if (side[i]) continue;
        double at = where(&f, i), s, top = best;
        if (at > r_max + 4e-16 * L) s = 1;                /* not what is only rounding */
        else if (at < r_min - 4e-16 * L) s = -1;
        else {
            if (v[i] == 0) continue;
            s = v[i] > 0 ? 1 : -1;
            double u = speed(&f, i);
            if (s * u >= 0 || (s > 0 ? r_max - r[i] : r[i] - r_min) > fabs(v[i]) * h + 0.5 * h * h * fabs(acc[i])) continue;
            top = sought(i, s, 0, h, 1);
            if (top > best) top = best;
        }
        double end = s > 0 ? r_max : r_min, g0 = s * (r[i] - end), lo = 0;
        if (g0 >= 0 && s * v[i] > 0) { *when = 0; return i; }
        if (top != b.h) { Flow ft = flow(top); if (s * (where(&ft, i) - end) <= 0) continue; }
        else if (s * (where(&b, i) - end) <= 0) continue;
        if (g0 >= 0) {                                /* just left it: away from the root at 0 */
            lo = top / 2;
            int k = 0;
            for (; k < 60; k++) {
                Flow fl = flow(lo);
                if (s * (where(&fl, i) - end) < 0) break;
                top = lo; lo /= 2;
            }
            if (k == 60) continue;                    /* pressed by no more than rounding */
        }
        best = sought(i, s, lo, top, 0);
        b = flow(best);
        who = i;
    }
    *when = best;
    return who;
}

static double hermite(double s, double h, double y0, double d0, double y1, double d1)
{
    double u = h > 0 ? s / h : 1, w = 1 - u;
    return w * w * (1 + 2 * u) * y0 + u * u * (3 - 2 * u) * y1 + h * u * w * (w * d0 - u * d1);
}

static FILE *out;
static double *ro, *vo;
#if MISTAKE == 40
static double *asked;
static int row_number;
#endif

static void row(double t)
{
    double c, J, th = theta, sum = 0, w;
    (void)sum;
    J = inertia(ro, &c);
    w = spin / J;
    if (frozen) { w = omega0; th = theta0 + omega0 * t; memcpy(ro, start, N * sizeof *ro); }
    else th = theta2;
#if MISTAKE == 38
    if (omega0 < 0) { w = -w; th = 2 * theta0 - th; }
#endif
#if MISTAKE == 25
    for (int i = 0; i < N; i++) sum += ro[i];
    c = sum / N;
#endif
#if MISTAKE == 40
    t = asked[row_number++];
#endif
    fprintf(out, "%.17g,%.17g,%.17g,%.17g,%.17g", t, th, w, c, J);
    for (int i = 0; i < N; i++) fprintf(out, ",%.17g", frozen ? start[i] : fmin(fmax(ro[i], r_min), r_max));
    for (int i = 0; i < N; i++) fprintf(out, ",%.17g", vo[i]);
    fprintf(out, "\n");
}

static void between(double t, double s, double h)     /* the row at s into a piece of h */
{
    double keep = theta2, W2 = weight(theta2), k = alpha / m;
    theta2 = hermite(s, h, theta, omega, theta2, omega2);
    for (int i = 0; i < N; i++) {
        if (side[i]) { ro[i] = r[i]; vo[i] = 0; continue; }
        double a0 = acc[i] - k * (v[i] - m * S / M), a1 = omega2 * omega2 * (r2[i] - rcm2) + W2 - k * (v2[i] - m * S2 / M);
        ro[i] = hermite(s, h, r[i], v[i], r2[i], v2[i]);
        vo[i] = hermite(s, h, v[i], a0, v2[i], a1);
#if MISTAKE == 28
        vo[i] = v[i];
#endif
        if (ro[i] > r_max) ro[i] = r_max;
        if (ro[i] < r_min) ro[i] = r_min;
    }
    row(t);
    theta2 = keep;
}

static void swap(void)
{
    double *s = r; r = r2; r2 = s;
    s = v; v = v2; v2 = s;
    theta = theta2;
#if MISTAKE != 34
    for (int i = 0; i < N; i++) {
        if (r[i] > r_max) r[i] = r_max;
        if (r[i] < r_min) r[i] = r_min;
    }
#endif
}

int main(int argc, char **argv)
{
    if (argc < 6) { fprintf(stderr, "eq8 scenario times start effort out\n"); return 2; }
    read_throw(argv);
    double steps = floor(strtod(argv[4], NULL) + 0.5), w = omega0;
    if (!(steps >= 1)) steps = 1;
#if MISTAKE == 31
    if (steps > 200) steps = 200;
#endif
    out = fopen(argv[5], "w");
    if (!out) { perror(argv[5]); return 2; }
#define ARRAY(a) a = calloc(N, sizeof *a)
    ARRAY(r); ARRAY(v); ARRAY(r2); ARRAY(v2); ARRAY(acc); ARRAY(side); ARRAY(ro); ARRAY(vo);
#if MISTAKE == 27
    for (int i = 0; i < N; i++) start[i] = L - fill * L * (i + 0.5) / N;
#endif
#if MISTAKE == 40
    asked = malloc(P * sizeof *asked);
    memcpy(asked, times, P * sizeof *asked);
    if (P > 1) for (int p = 2; p < P; p++) times[p] = times[0] + p * (times[1] - times[0]);
#endif
    for (int i = 0; i < N; i++) {
        r[i] = start[i];
        if (!frozen && r[i] > r_max - 1e-12 * L) r[i] = r_max;
        if (!frozen && r[i] < r_min + 1e-12 * L) r[i] = r_min;
        ro[i] = r[i];
    }
    J0 = inertia(r, &rcm);
#if MISTAKE == 38
    w = fabs(omega0);
#endif
    spin = J0 * w;
    theta = theta2 = theta0;
    u_rest = fmax(fabs(omega0) * L * 1e-6, 1e-9);
    fprintf(out, "t,theta,omega,r_cm,inertia");
    for (int i = 0; i < N; i++) fprintf(out, ",r_%d", i);
    for (int i = 0; i < N; i++) fprintf(out, ",v_%d", i);
    fprintf(out, "\n");
    int p = 0;
    if (frozen) { for (; p < P; p++) row(times[p]); return fclose(out) != 0; }
    settle(1e-300);
    begin();
    omega2 = omega; rcm2 = rcm; memcpy(r2, r, N * sizeof *r);
    while (p < P && times[p] <= 0) row(times[p++]);
    double H = T / steps;
#if MISTAKE == 29
    double *rs = malloc(N * sizeof *rs), *vs = malloc(N * sizeof *vs), *as = malloc(N * sizeof *as);
#endif
#if MISTAKE == 35
    float clock = 0, Hf = (float)H;
#endif
    for (long k = 0; k < (long)steps && p < P; k++) {
        double t = k * H, t1 = k + 1 == (long)steps ? T : (k + 1) * H;
#if MISTAKE == 35
        t = clock; clock += Hf; t1 = t + H;
#endif
#if MISTAKE == 29
        double ts = t, ths, oms, rcs;
        int fresh = 0;
        t_piece = t; begin();
        memcpy(rs, r, N * sizeof *r); memcpy(vs, v, N * sizeof *r); memcpy(as, acc, N * sizeof *r); ths = theta; oms = omega; rcs = rcm; (void)rcs; (void)fresh;
#endif
        while (t < t1 && p < P) {
            double h = t1 - t, tau;
            t_piece = t;
            begin();
            int released = 0, who = earliest(h, &tau);
#if MISTAKE == 34
            who = -1; tau = h;
#endif
            trial(tau);
            if (on_base + on_cap) {
                double q1 = press2();
                if (q1 < 0) {
                    double a = on_base ? pressing(1, omega, rcm, theta, S) : 1, b = on_cap ? pressing(-1, omega, rcm, theta, S) : 1;
                    double lo = 0, hi = tau, q0 = a < b ? a : b;
                    for (int i = 0; i < 60 && hi - lo > 1e-15 * H; i++) {
                        double f = q0 > 0 && i % 3 != 2 ? q0 / (q0 - q1) : 0.5, y = lo + f * (hi - lo);
                        if (!(y > lo && y < hi)) y = (lo + hi) / 2;
                        trial(y);
                        double q = press2();
                        if (q < 0) { hi = y; q1 = q; if (q > -1e-14 * (omega2 * omega2 * L + g)) break; } else { lo = y; q0 = q; }
                    }
                    tau = hi; trial(tau);
                    who = -1; released = 1;
                }
            }
#if MISTAKE != 29
            double until = tau < h ? t + tau : t1;
#if MISTAKE == 30
            while (p < P && times[p] < until) { between(times[p], times[p] - t, tau); p++; }
#else
            while (p < P && times[p] <= until) { between(times[p], times[p] - t, tau); p++; }
#endif
#endif
            swap();
            t = tau < h ? t + tau : t1;
#if MISTAKE == 34
            int hits = 0;
            for (int i = 0; i < N; i++) {
                if (side[i]) continue;
                double s = r[i] > r_max ? 1 : r[i] < r_min ? -1 : 0;
                if (s != 0) { hits++; r[i] = s > 0 ? r_max : r_min; if (s * v[i] > 0) v[i] *= -e; }
            }
            if (hits) settle(u_rest); else
#endif
            if (who >= 0) {
                events++;
                for (int i = 0; i < N; i++) {
                    if (side[i]) continue;
                    double s = v[i] > 0 ? 1 : -1, end = s > 0 ? r_max : r_min;
                    if (i == who || s * (r[i] - end) > -1e-13 * L) {
                        if (i == who) {
                            s = r[i] > L / 2 ? 1 : -1; end = s > 0 ? r_max : r_min;
                            if (s * v[i] < 0) v[i] = 0;
                        }
                        r[i] = end; v[i] = -e * v[i];
                    }
                }
                settle(u_rest);
            } else if (released) { events++; settle(1e-300); }
            if (events > 4000000 || !isfinite(theta)) { t = t1; k = (long)steps; }
        }
#if MISTAKE == 29
        if (p < P && times[p] <= t1) {
            double c0 = theta, c1 = omega, c2 = rcm;
            t_piece = t1; begin();
            memcpy(r2, rs, N * sizeof *r); memcpy(v2, vs, N * sizeof *r);
            for (; p < P && times[p] <= t1; p++) {
                double s = times[p] - ts, hh = t1 - ts;
                theta2 = hermite(s, hh, ths, oms, theta, omega);
                for (int i = 0; i < N; i++) {
                    ro[i] = hermite(s, hh, rs[i], vs[i], r[i], v[i]);
                    vo[i] = vs[i] + s / hh * (v[i] - vs[i]);
                    ro[i] = fmin(fmax(ro[i], r_min), r_max);
                }
                row(times[p]);
            }
            theta = c0; (void)c1; (void)c2;
        }
#endif
    }
#if MISTAKE == 30
    memcpy(ro, r2, N * sizeof *r); memcpy(vo, v2, N * sizeof *r);
    theta2 = theta - H * (omega + omega2) / 2;        /* the state the last step began with */
    while (p < P) row(times[p++]);
#else
    if (p < P) { begin(); theta2 = theta; memcpy(ro, r, N * sizeof *r); memcpy(vo, v, N * sizeof *r); }
    while (p < P) row(times[p++]);
#endif
    return fclose(out) != 0;
}
