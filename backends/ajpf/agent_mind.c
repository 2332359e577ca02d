/* Minds and intentions: interned as rows of numbers, and as they are worked on. Part of agent.c. */

/* Intentions: frames, the bottom one first. `null` is what is left of a deed that posted a goal to be performed. */
enum { STARTS = -2, PERCEIVES = -3, OPEN = -1 };
typedef struct {
    int event, drop, isgoal, kind, plan, at, null, fresh, env[MAXVARS]; /* event, env: of the heap */
} Frame;
typedef struct {
    int n, waiting, locked;
    Frame f[MAXFRAMES];
} Intention;
#define FRAME (8 + MAXVARS)
static Pool gw_its;
#define NOBODY 0 /* the intention without frames */

static void gw_load(Intention *x, int number) {
    int i, v, n, own[MAXFREE];
    const int *row = gw_row(&gw_its, number, &n);
    for (i = 0; i < MAXFREE; i++) own[i] = UNBOUND;
    x->waiting = row[0];
    x->locked = row[1];
    x->n = (n - 2) / FRAME;
    for (i = 0, row += 2; i < x->n; i++, row += FRAME) {
        memcpy(&x->f[i], row, FRAME * sizeof(int));
        x->f[i].event = gw_import(row[0], own);
        for (v = 0; v < MAXVARS; v++) x->f[i].env[v] = row[8 + v] < 0 ? UNBOUND : gw_import(row[8 + v], own);
    }
}
static int gw_store(const Intention *x) {
    int i, v, row[2 + MAXFRAMES * FRAME], *to = row + 2;
    Order order;
    order.n = 0;
    row[0] = x->waiting;
    row[1] = x->locked;
    if (!x->n) row[0] = row[1] = 0;
    for (i = 0; i < x->n; i++, to += FRAME) {
        const Frame *f = &x->f[i];
        unsigned long long live = 0;
        if (f->plan >= 0 && f->at < plans[f->plan].n) live = plans[f->plan].deeds[f->at].live;
        memcpy(to, f, 8 * sizeof(int));
        to[0] = gw_export(f->event, &order);
        for (v = 0; v < MAXVARS; v++)
            to[8 + v] = live >> v & 1 && f->env[v] != UNBOUND ? gw_export(f->env[v], &order) : -1;
    }
    return gw_intern(&gw_its, row, 2 + x->n * FRAME);
}
static void gw_push(Intention *x, int event, int drop, int isgoal, int kind, int plan) {
    Frame *f = &x->f[x->n];
    if (x->n++ == MAXFRAMES) gw_give_up("too many goals on goals");
    f->event = event;
    f->drop = drop;
    f->isgoal = isgoal;
    f->kind = kind;
    f->plan = plan;
    f->at = f->null = f->fresh = 0;
    gw_unbound(f->env);
}
static int gw_single(int event, int drop, int kind, int plan) { /* about a belief; the term is interned */
    Intention x;
    memset(&x, 0, sizeof x);
    gw_push(&x, gw_import(event, 0), drop, 0, kind, plan);
    return gw_store(&x);
}
static int gw_left(const Frame *f) {
    if (f->plan == OPEN) return -1;
    if (f->plan < 0) return f->at ? f->null : 1;
    return plans[f->plan].n - f->at + f->null;
}
/* The current deed's term; of what is waited for, too */
static int gw_deed_term(Frame *f) { return gw_build(plans[f->plan].deeds[f->at].pat, f->env); }
static int gw_waits(int it) {
    int n;
    return gw_row(&gw_its, it, &n)[0];
}
static int gw_locks(int it) {
    int n;
    return gw_row(&gw_its, it, &n)[1];
}

/* Minds */
static Pool gw_minds;
static void gw_recall(Mind *m, int number, const Agent *of) {
    int n;
    const int *row = gw_row(&gw_minds, number, &n);
    memcpy(m, row, 7 * sizeof(int));
    row += 7;
    memcpy(m->bel, row, m->nb * sizeof(int));
    memcpy(m->seen, row + m->nb, m->nb * sizeof(int));
    memcpy(m->goal, row + 2 * m->nb, m->ng * sizeof(int));
    memcpy(m->q, row + 2 * m->nb + m->ng, m->nq * sizeof(int));
    m->of = of;
}
static int gw_keep(const Mind *m) {
    int row[8 + 2 * MAXBEL + MAXGOALS + MAXQUEUE], *to = row + 7;
    memcpy(row, m, 7 * sizeof(int));
    memcpy(to, m->bel, m->nb * sizeof(int));
    memcpy(to + m->nb, m->seen, m->nb * sizeof(int));
    memcpy(to + 2 * m->nb, m->goal, m->ng * sizeof(int));
    memcpy(to + 2 * m->nb + m->ng, m->q, m->nq * sizeof(int));
    to += 2 * m->nb + m->ng + m->nq;
    *to++ = m->of - agents; /* one agent's mind is not another's */
    return gw_intern(&gw_minds, row, to - row);
}
static int gw_has(const Mind *m, int t) {
    int i;
    for (i = 0; i < m->nb; i++)
        if (m->bel[i] == t) return 1;
    return 0;
}
static void gw_add(Mind *m, int t, int seen) {
    int i;
    if (gw_has(m, t)) return;
    if (m->nb == MAXBEL) gw_give_up("too many beliefs");
    for (i = m->nb++; i && gw_before(t, m->bel[i - 1]); i--) {
        m->bel[i] = m->bel[i - 1];
        m->seen[i] = m->seen[i - 1];
    }
    m->bel[i] = t;
    m->seen[i] = seen;
}
static void gw_rid(Mind *m, int at) {
    m->nb--;
    memmove(m->bel + at, m->bel + at + 1, (m->nb - at) * sizeof(int));
    memmove(m->seen + at, m->seen + at + 1, (m->nb - at) * sizeof(int));
}
/* Goals: twice the term's number, and 1 more for one to achieve */
static int gw_wants(const Mind *m, int t, int kind) {
    int i;
    for (i = 0; i < m->ng; i++)
        if (m->goal[i] == 2 * t + kind) return i;
    return -1;
}
static void gw_want(Mind *m, int t, int kind) {
    int i;
    if (gw_wants(m, t, kind) >= 0) return;
    if (m->ng == MAXGOALS) gw_give_up("too many goals");
    for (i = m->ng++; i; i--) {
        int u = m->goal[i - 1] / 2;
        if (u == t ? kind : !gw_before(t, u)) break;
        m->goal[i] = m->goal[i - 1];
    }
    m->goal[i] = 2 * t + kind;
}
static void gw_unwant(Mind *m, int t, int kind) {
    int i = gw_wants(m, t, kind);
    if (i < 0) return;
    m->ng--;
    memmove(m->goal + i, m->goal + i + 1, (m->ng - i) * sizeof(int));
}

/* The queue */
static void gw_put(Mind *m, int it) {
    if (m->nq == MAXQUEUE) gw_give_up("too many intentions at once");
    m->q[m->nq++] = it;
}
static int gw_take(Mind *m, int at) {
    int it = m->q[at];
    m->nq--;
    memmove(m->q + at, m->q + at + 1, (m->nq - at) * sizeof(int));
    return it;
}
static int gw_sift(Mind *m) { /* those that can go on, then those that wait; how many can */
    int q[MAXQUEUE], i, k = 0, ready;
    for (i = 0; i < m->nq; i++)
        if (!gw_waits(m->q[i])) q[k++] = m->q[i];
    ready = k;
    for (i = 0; i < m->nq; i++)
        if (gw_waits(m->q[i])) q[k++] = m->q[i];
    memcpy(m->q, q, m->nq * sizeof(int));
    return ready;
}
/* An intention that waited for what has changed goes on */
static int gw_woken(const Mind *m, int it, int t) {
    Intention x;
    Frame *f;
    int trail = gw_ntrail, wakes, wanted;
    if (!gw_waits(it)) return it;
    gw_load(&x, it);
    f = &x.f[x.n - 1];
    wanted = gw_computed(gw_deed_term(f));
    if (EDGE)
        wakes = gw_believes(m, wanted, 0, 0) != (plans[f->plan].deeds[f->at].what == WAITSNOT);
    else
        wakes = gw_unify(wanted, gw_import(t, 0));
    gw_undo(trail);
    if (!wakes) return it;
    x.waiting = 0;
    return gw_store(&x);
}
static void gw_wake(Mind *m, int t) {
    int i;
    for (i = 0; i < m->nq; i++) m->q[i] = gw_woken(m, m->q[i], t);
}
/* Without its next deed; a goal whose frame goes leaves the goal base */
static void gw_tail(Mind *m, Intention *x) {
    Frame *f = &x->f[x->n - 1];
    if (f->null)
        f->null = 0;
    else
        f->at++;
    f->fresh = 0;
    if (gw_left(f) > 0) return;
    if (f->isgoal) gw_unwant(m, gw_export(f->event, 0), f->kind);
    x->n--;
}
/* The order of those that wait: rows, then the text of the event */
static int gw_rows(const Intention *x) {
    int i, n = 0;
    for (i = 0; i < x->n; i++) n += gw_left(&x->f[i]) > 1 && !x->f[i].fresh ? 2 : 1;
    return n;
}
static char *gw_event(const Frame *f) {
    static const char *const kinds[] = {" [perform]", " [achieve]"};
    int t = gw_export(f->event, 0);
    char *text = gw_join(f->drop ? "-" : "+", f->isgoal ? "!" : "", "");
    if (gw_functor(t) == RECEIVED || gw_functor(t) == SENT) {
        text = gw_longer(text, gw_names[gw_functor(t)], "(:");
        text = gw_longer(text, gw_shown[gw_export(gw_arg(t, 2), 0)].text, ",");
        return gw_longer(text, gw_shown[gw_export(gw_arg(t, 3), 0)].text, ")");
    }
    return gw_longer(text, gw_shown[t].text, f->isgoal ? kinds[f->kind] : "");
}
static int gw_lighter(int a, int b) {
    Intention x, y;
    char *u, *v;
    int less;
    gw_load(&x, a);
    gw_load(&y, b);
    if (gw_rows(&x) != gw_rows(&y)) return gw_rows(&x) < gw_rows(&y);
    u = gw_event(&x.f[x.n - 1]);
    v = gw_event(&y.f[y.n - 1]);
    less = gw_order(u, v) < 0;
    free(u);
    free(v);
    return less;
}
