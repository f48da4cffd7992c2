/* The floor: the plant's integration scheme in plain C, one number after the other, for comparison of cost.
 *
 * The same substeps, midpoints, exponentials and corners as plant/src/integrator.rs and its neighbours, without
 * emergency stop, hands and added weights. It is only ever compared with the crate: ../benches/period.rs checks that both
 * give the same trajectory before it times them.
 */
#include <math.h>

enum { POINTS = 6, HINGES = POINTS - 1, SUBSTEPS = 10, PARTS = 8 };

struct rig {
    double supply, exhaust, atmosphere, normal;
    double tau_spool, tau_flow;
    double opening[POINTS], kv_supply[POINTS], kv_exhaust[POINTS];
    double stroke, area_a, area_b, dead;
    double f_static, f_sliding, viscous, mass[2];
    double gap, stiffness, damping;
};

struct axis { double x, v, s, m_a, m_b, q_a, q_b; };

struct factors { double keep, gain, drift, push; };

struct span {
    double h, spool_half, spool_full, q_keep, q_carried, q_fed, q_half;
    struct factors half[2], full[2];
};

struct plant {
    struct rig rig;
    struct span coarse, fine;
    double supply_hinge[HINGES], exhaust_hinge[HINGES];
};

static struct factors factors(double m, double b, double h) {
    double z = b * h / m, phi_1 = z == 0 ? 1 : -expm1(-z) / z, phi_2 = 0;
    if (z > 0.1) phi_2 = (1 - phi_1) / z;
    else for (int n = 9; n >= 0; n--) phi_2 = (1 - z * phi_2) / (n + 2);
    return (struct factors){exp(-z), h / m * phi_1, h * phi_1, h * h / m * phi_2};
}

static struct span span(const struct rig *r, double h) {
    double carried = -r->tau_flow * expm1(-h / r->tau_flow);
    struct span s;
    s.h = h;
    s.spool_half = exp(-h / 2 / r->tau_spool);
    s.spool_full = exp(-h / r->tau_spool);
    s.q_keep = exp(-h / r->tau_flow);
    s.q_carried = r->normal * carried;
    s.q_fed = r->normal * (h - carried);
    s.q_half = r->normal * h / 2;
    for (int i = 0; i < 2; i++) {
        s.half[i] = factors(r->mass[i], r->viscous, h / 2);
        s.full[i] = factors(r->mass[i], r->viscous, h);
    }
    return s;
}

static void hinges(const double *o, const double *kv, double *hinge) {
    double before = 0;
    for (int i = 0; i < HINGES; i++) {
        double slope = (kv[i + 1] - kv[i]) / (o[i + 1] - o[i]) * (25.9 / 1e5 / 3600);
        hinge[i] = slope - before;
        before = slope;
    }
}

unsigned long floor_size(void) { return sizeof(struct plant); }

void floor_new(struct plant *p, const struct rig *rig) {
    p->rig = *rig;
    p->coarse = span(rig, 1e-3 / SUBSTEPS);
    p->fine = span(rig, 1e-3 / SUBSTEPS / PARTS);
    hinges(rig->opening, rig->kv_supply, p->supply_hinge);
    hinges(rig->opening, rig->kv_exhaust, p->exhaust_hinge);
}

static double flow(double conductance, double far, double p) {
    double up = far > p ? far : p, down = far > p ? p : far;
    double throat = down > up / 2 ? down : up / 2;
    return copysign(conductance * sqrt((up - throat) * throat), far - p);
}

struct middle { double force, growth, edge_a, edge_b; };

static struct middle middle(const struct plant *p, const struct span *h, const struct axis *a, double u) {
    const struct rig *r = &p->rig;
    double s = u + (a->s - u) * h->spool_half, opening = fabs(s), supply = 0, exhaust = 0;
    for (int i = 0; i < HINGES; i++) {
        double beyond = opening - r->opening[i];
        beyond = beyond > 0 ? beyond : 0;
        supply += p->supply_hinge[i] * beyond;
        exhaust += p->exhaust_hinge[i] * beyond;
    }
    double x = a->x + a->v * (h->h / 2);
    x = x > 0 ? x : 0;
    x = x < r->stroke ? x : r->stroke;
    double per_a = 1 / (r->dead + r->area_a * x), per_b = 1 / (r->dead + r->area_b * (r->stroke - x));
    double p_a = (a->m_a + a->q_a * h->q_half) * per_a, p_b = (a->m_b + a->q_b * h->q_half) * per_b;
    struct middle mid;
    mid.force = p_a * r->area_a - p_b * r->area_b - r->atmosphere * (r->area_a - r->area_b);
    mid.growth = (r->area_a * per_a * a->q_a - r->area_b * per_b * a->q_b) * h->q_half;
    mid.edge_a = s > 0 ? flow(supply, r->supply, p_a) : flow(exhaust, r->exhaust, p_a);
    mid.edge_b = s > 0 ? flow(exhaust, r->exhaust, p_b) : flow(supply, r->supply, p_b);
    return mid;
}

static double overlap(const struct rig *r, double d) {
    double half = r->gap / 2;
    return d > half ? d - half : d < -half ? d + half : 0;
}

static double pushing(double e, double f) { return e * f > 0 ? f : 0; }

static double contact(const struct rig *r, double d, double speed, double mobility, double h, int closing) {
    double e = overlap(r, d);
    if (e != 0) {
        double reach = r->stiffness * (h / 2) + r->damping;
        return pushing(e, (r->stiffness * e + reach * speed) / (1 + reach * mobility));
    }
    if (!closing || (e = overlap(r, d + h * speed)) == 0) return 0;
    double share = e / (h * speed);
    if (share > 1) share = 1;
    double reach = r->stiffness * share * (h / 2) + r->damping;
    return share * reach * speed / (1 + share * share * reach * mobility);
}

static int holds(const struct rig *r, double x, double force) {
    return fabs(force) <= r->f_static || (x <= 0 && force < 0) || (x >= r->stroke && force > 0);
}

static void air(const struct span *h, double m, double q, double edge, double *m_1, double *q_1) {
    *m_1 = m + q * h->q_carried + edge * h->q_fed;
    *q_1 = edge + (q - edge) * h->q_keep;
}

/* Stops the air at the bounds; returns whether the instant of crossing matters. */
static int stop(const struct rig *r, double m, double *m_1, double *q_1, double volume) {
    double most = volume * r->supply, least = volume * r->exhaust, stored = *m_1;
    most = most > m ? most : m;
    least = least < m ? least : m;
    stored = stored < most ? stored : most;
    stored = stored > least ? stored : least;
    double beyond = fabs(*m_1 - stored);
    if (beyond > 0) *q_1 = 0;
    *m_1 = stored;
    return beyond > stored * 1e-6;
}

static void hold(const struct rig *r, double m, double q, double v, double *m_1, double *q_1, double v_1) {
    double p = m / v, p_1 = *m_1 / v_1, bound;
    if (p_1 > r->supply && (q > 0 || *q_1 > 0)) bound = r->supply;
    else if (p_1 < r->exhaust && (q < 0 || *q_1 < 0)) bound = r->exhaust;
    else return;
    *q_1 = 0;
    if ((p - bound) * (p_1 - bound) >= 0) {
        *m_1 = m;
        return;
    }
    double at = m + (bound - p) / (p_1 - p) * (*m_1 - m), low = v < v_1 ? v : v_1, high = v < v_1 ? v_1 : v;
    *m_1 = at < bound * low ? bound * low : at > bound * high ? bound * high : at;
}

/* A step that assumes no corner; returns whether there may be one. */
static int smooth(const struct plant *p, const struct axis *a, const double *u, int linked, struct axis *out) {
    const struct rig *r = &p->rig;
    const struct span *h = &p->coarse;
    struct middle mid[2];
    double force[2], f_c = 0;
    int corner = 0;
    for (int i = 0; i < 2; i++) {
        mid[i] = middle(p, h, &a[i], u[i]);
        force[i] = mid[i].force - (a[i].v != 0 ? copysign(r->f_sliding, a[i].v) : 0);
    }
    double d = r->stroke - (a[0].x + a[1].x);
    double margin = linked && (a[0].v != 0 || a[1].v != 0) ? 0.5 : 0;
    if (linked) {
        double speed = 0, mobility = 0;
        for (int i = 0; i < 2; i++) {
            if (a[i].v != 0) {
                speed -= h->half[i].keep * a[i].v + h->half[i].gain * force[i];
                mobility += h->half[i].gain;
            }
        }
        f_c = contact(r, d, speed, mobility, h->h, 0);
    }
    for (int i = 0; i < 2; i++) {
        const struct factors *f = &h->full[i];
        double total = force[i] + f_c;
        out[i] = a[i];
        if (a[i].v != 0) {
            out[i].v = f->keep * a[i].v + f->gain * total;
            out[i].x = a[i].x + f->drift * a[i].v + f->push * total;
            corner |= out[i].v * a[i].v <= 0 || out[i].x < 0 || out[i].x > r->stroke;
        } else {
            int pressed = (a[i].x <= 0 && total < 0) || (a[i].x >= r->stroke && total > 0);
            corner |= !pressed && fabs(total) + fabs(mid[i].growth) + margin > r->f_static;
        }
        out[i].s = u[i] + (a[i].s - u[i]) * h->spool_full;
        air(h, a[i].m_a, a[i].q_a, mid[i].edge_a, &out[i].m_a, &out[i].q_a);
        air(h, a[i].m_b, a[i].q_b, mid[i].edge_b, &out[i].m_b, &out[i].q_b);
        corner |= stop(r, a[i].m_a, &out[i].m_a, &out[i].q_a, r->dead + r->area_a * out[i].x);
        corner |= stop(r, a[i].m_b, &out[i].m_b, &out[i].q_b, r->dead + r->area_b * (r->stroke - out[i].x));
    }
    if (linked) {
        double e = overlap(r, r->stroke - (out[0].x + out[1].x));
        corner |= e != 0 && overlap(r, d) * e <= 0;
    }
    return corner;
}

static void stop_at_ends(const struct rig *r, double *x, double *v) {
    if (*x < 0) *x = 0, *v = 0;
    if (*x > r->stroke) *x = r->stroke, *v = 0;
}

static void move(const struct rig *r, int i, double *x, double *v, double force, double left) {
    for (int leg = 0; leg < 3; leg++) {
        if (*v == 0 && holds(r, *x, force)) return;
        double direction = *v != 0 ? copysign(1, *v) : copysign(1, force);
        double driving = force - direction * r->f_sliding;
        struct factors f = factors(r->mass[i], r->viscous, left);
        double v_1 = f.keep * *v + f.gain * driving, x_1 = *x + f.drift * *v + f.push * driving;
        if (v_1 * direction > 0) {
            *x = x_1, *v = v_1;
            stop_at_ends(r, x, v);
            return;
        }
        if (*v == 0) return;
        double t = -*v * r->mass[i] / driving, y = r->viscous * t / r->mass[i];
        if (y != 0) t *= log1p(y) / y;
        if (!(t < left)) t = left;
        f = factors(r->mass[i], r->viscous, t);
        *x += f.drift * *v + f.push * driving;
        *v = 0;
        stop_at_ends(r, x, v);
        left -= t;
    }
}

/* A short step that may meet any corner. */
static void careful(const struct plant *p, struct axis *a, const double *u, int linked) {
    const struct rig *r = &p->rig;
    const struct span *h = &p->fine;
    struct middle mid[2];
    double friction[2], f_c = 0, d = r->stroke - (a[0].x + a[1].x);
    int moving[2], starts = 0;
    for (int i = 0; i < 2; i++) {
        mid[i] = middle(p, h, &a[i], u[i]);
        moving[i] = a[i].v != 0;
        friction[i] = moving[i] ? -copysign(r->f_sliding, a[i].v) : 0;
    }
    for (int pass = 0; linked && pass < 2; pass++) {
        double speed = 0, mobility = 0;
        for (int i = 0; i < 2; i++) {
            if (moving[i]) {
                speed -= h->half[i].keep * a[i].v + h->half[i].gain * (mid[i].force + friction[i]);
                mobility += h->half[i].gain;
            }
        }
        f_c = contact(r, d, speed, mobility, h->h, 1);
        for (int i = 0; pass == 0 && i < 2; i++) {
            if (!moving[i] && !holds(r, a[i].x, mid[i].force + f_c)) {
                friction[i] = -copysign(r->f_sliding, mid[i].force + f_c);
                moving[i] = starts = 1;
            }
        }
        if (!starts) break;
    }
    for (int i = 0; i < 2; i++) {
        struct axis b = a[i];
        move(r, i, &b.x, &b.v, mid[i].force + f_c, h->h);
        b.s = u[i] + (b.s - u[i]) * h->spool_full;
        air(h, a[i].m_a, a[i].q_a, mid[i].edge_a, &b.m_a, &b.q_a);
        air(h, a[i].m_b, a[i].q_b, mid[i].edge_b, &b.m_b, &b.q_b);
        hold(r, a[i].m_a, a[i].q_a, r->dead + r->area_a * a[i].x, &b.m_a, &b.q_a, r->dead + r->area_a * b.x);
        hold(r, a[i].m_b, a[i].q_b, r->dead + r->area_b * (r->stroke - a[i].x), &b.m_b, &b.q_b,
             r->dead + r->area_b * (r->stroke - b.x));
        a[i] = b;
    }
}

/* One period of 1 ms. */
void floor_step(const struct plant *p, struct axis *axes, const double *u, int linked) {
    for (int k = 0; k < SUBSTEPS; k++) {
        struct axis next[2];
        if (smooth(p, axes, u, linked, next)) {
            for (int part = 0; part < PARTS; part++) careful(p, axes, u, linked);
        } else {
            axes[0] = next[0];
            axes[1] = next[1];
        }
    }
}
