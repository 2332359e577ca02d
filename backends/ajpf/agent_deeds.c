/* The second half of a cycle: one deed of the current intention. Part of agent.c. */

typedef struct {
    Intention x;   /* the current intention, which the deed changes */
    Frame *f;      /* its top frame */
    const Deed *d; /* the deed; none where an initial goal or a percept is taken up */
    int kind, t;   /* what the deed does; its term, or -1 where that has a free variable */
} Doing;

static int gw_fits(const Frame *f, int t) { return f->isgoal && f->event == t; }
static void gw_keep(S *s, Doing *o) { s->cur = gw_intention(&o->x); }
static void gw_done(S *s, Doing *o) {
    gw_tail(s, &o->x);
    gw_keep(s, o);
}
/* Whether a ground term is believed, or the head of a rule whose body holds */
static int gw_derives(const S *s, int t) {
    short none[MAXVARS], b[MAXVARS];
    int i, met = gw_has(s, t);
    gw_unbound(none);
    for (i = 0; i < NRULES && !met; i++)
        if (gw_ground(rules[i].head, none) == t) {
            memcpy(b, none, sizeof b);
            met = gw_holds(s, rules[i].body, rules[i].n, b, 1);
        }
    return met;
}

static int gw_act(S *s, Doing *o, int way) {
    int name = pats[o->d->pat].functor, silent = name == PRINT, row = gw_narrowing(name), had, k, found[NGROUPS + 1];
    if (o->t < 0 && !silent) gw_give_up("an action with a free variable");
    for (k = 0; k < NQUIET && quiet[k] != name; k++);
    if (silent || k < NQUIET) row = 0;
    if (way < 0) return row ? gw_count(row) : 1;
    gw_done(s, o);
    s->planned = s->waited = 0;
    if (!silent) s->last = o->t;
    if (row) {
        had = gw_offered(s->now, found) > 0;
        gw_draw(s, row, way);
        s->fresh = s->fresh || had || gw_offered(s->now, found) > 0;
    }
    return 1;
}

static void gw_add_belief(S *s, Doing *o) {
    int known;
    if (o->t < 0) gw_give_up("a belief with a free variable");
    known = gw_derives(s, o->t);
    gw_add(s, o->t, o->x.f[0].plan == PERCEIVES);
    gw_done(s, o);
    gw_wake(s, o->t);
    if (!known) gw_put(s, gw_single(o->t, 0, 0, 0, OPEN));
}

static void gw_drop_belief(S *s, Doing *o) {
    int i, gone = 0, lost[MAXBEL];
    short b[MAXVARS], first[MAXVARS];
    for (i = 0; i < s->nb;) {
        memcpy(b, o->f->b, sizeof b);
        if (o->t >= 0 ? s->bel[i] == o->t : gw_match(o->d->pat, s->bel[i], b)) {
            if (!gone) memcpy(first, b, sizeof b);
            lost[gone++] = s->bel[i];
            gw_rid(s, i);
        } else
            i++;
    }
    if (o->t < 0 && gone) { /* the event keeps the variable: it may be another only if no plan asks for it */
        for (i = 0; i < NPLANS; i++)
            if (plans[i].drop && !plans[i].isgoal && pats[plans[i].trigger].functor == pats[o->d->pat].functor)
                gw_give_up("a plan for a dropped belief with a free variable");
        memcpy(o->f->b, first, sizeof first);
    }
    gw_done(s, o);
    if (o->t >= 0) gw_wake(s, o->t);
    for (i = 0; o->t < 0 && i < s->nq; i++)
        if (gw_its[s->q[i]].waiting) gw_give_up("waiting for a belief with a free variable");
    for (i = 0; i < gone; i++) gw_put(s, gw_single(lost[i], 1, 0, 0, OPEN));
}

static void gw_wait(S *s, Doing *o) {
    short b[MAXVARS];
    int met, i, j, k;
    memcpy(b, o->f->b, sizeof b);
    met = gw_believes(s, o->d->pat, b, 0, 0, 0);
    if (o->kind == WAITS ? met : !met) {
        if (o->kind == WAITS) memcpy(o->f->b, b, sizeof b);
        gw_done(s, o);
        return;
    }
    o->x.waiting = 1;
    gw_keep(s, o);
    if (!gw_ready(s)) {
        gw_put(s, s->cur);
        o->x.n = 0;
        gw_keep(s, o);
        s->asleep = 1;
    }
    gw_sift(s);
    for (k = 0; k < s->nq && !gw_its[s->q[k]].waiting; k++);
    for (i = k + 1; i < s->nq; i++) { /* those that wait are sorted by their weights */
        int it = s->q[i];
        for (j = i; j > k && gw_lighter(it, s->q[j - 1]); j--) s->q[j] = s->q[j - 1];
        s->q[j] = it;
    }
}

/* Whether an achieve goal is believed already; it then leaves the goal base, unless another intention is at it */
static int gw_achieved(S *s, Doing *o) {
    short b[MAXVARS];
    int i, k, elsewhere = 0;
    memcpy(b, o->f->b, sizeof b);
    if (!(o->d ? gw_believes(s, o->d->pat, b, 0, 0, 0) : gw_derives(s, o->t))) return 0;
    if (o->t < 0) gw_give_up("an achieved goal with a free variable");
    for (i = 0; i < s->nq; i++)
        for (k = 0; k < gw_its[s->q[i]].n; k++) elsewhere |= gw_fits(&gw_its[s->q[i]].f[k], o->t);
    memcpy(o->f->b, b, sizeof b);
    gw_done(s, o);
    if (!elsewhere) gw_unwant(s, o->t, 1);
    return 1;
}

static void gw_add_goal(S *s, Doing *o) {
    int kind = o->d ? o->d->kind : o->f->kind;
    if (kind && gw_achieved(s, o)) return;
    if (o->t < 0) gw_give_up("a goal with a free variable");
    if (kind && gw_wants(s, o->t, 1) >= 0) {
        gw_done(s, o);
        return;
    }
    gw_want(s, o->t, kind);
    if (o->x.n == MAXFRAMES) gw_give_up("too many goals on goals");
    o->f->fresh = 0;
    if (!kind) {
        o->f->at++;
        o->f->null = 1;
    }
    o->x.f[o->x.n++] = fresh_frame(o->t, 0, 1, kind, OPEN);
    gw_keep(s, o);
}

/* Cut off what stands on the goal, and the deed that posted it; where only its kind or sign differs, that deed alone.
   Whether it was there at all. */
static int gw_cut(S *s, Intention *x, int t, int kind) {
    int i, exact = -1, loose = 0;
    for (i = x->n - 1; i >= 0; i--)
        if (gw_fits(&x->f[i], t)) {
            loose = 1;
            if (!x->f[i].drop && x->f[i].kind == kind) exact = i;
        }
    if (!loose) return 0;
    if (exact >= 0) x->n = exact;
    x->waiting = 0;
    gw_tail(s, x);
    return 1;
}
/* Whether the next deed of the frame posts the goal */
static int gw_posts(const Frame *f, int t) {
    const Deed *d;
    if (f->null) return 0;
    if (f->plan == STARTS) return !f->at && f->event == t;
    if (f->plan < 0) return 0;
    d = &plans[f->plan].deeds[f->at];
    return d->what == ADDGOAL && gw_ground(d->pat, f->b) == t;
}
static void gw_drop_goal(S *s, Doing *o) {
    int i, j, kind = o->d->kind;
    Intention lost, was = o->x;
    memset(&lost, 0, sizeof lost);
    if (o->t < 0) gw_give_up("a dropped goal with a free variable");
    gw_unwant(s, o->t, kind);
    if (gw_cut(s, &o->x, o->t, kind))
        lost = was;
    else {
        for (j = 0; j < s->nq;) {
            Intention y = gw_its[s->q[j]];
            was = y;
            if (gw_cut(s, &y, o->t, kind))
                lost = was;
            else if (!kind && gw_posts(&y.f[y.n - 1], o->t))
                gw_tail(s, &y);
            if (y.n)
                s->q[j++] = gw_intention(&y);
            else
                gw_take(s, j);
        }
        gw_tail(s, &o->x);
    }
    for (i = 0; i < lost.n; i++)
        if (lost.f[i].isgoal) gw_unwant(s, lost.f[i].event, lost.f[i].kind);
    gw_keep(s, o);
}

static int gw_deed(S *s, int way) { /* the ways that there are; does it if way >= 0 */
    Doing o;
    o.x = gw_its[s->cur];
    o.f = &o.x.f[o.x.n - 1];
    o.d = o.f->plan >= 0 ? &plans[o.f->plan].deeds[o.f->at] : 0;
    if (o.f->plan == OPEN || o.f->null) { /* no plan, and none will come; or nothing left of a goal that was posted */
        if (way < 0) return 1;
        s->planned = 0;
        if (o.f->plan != OPEN) gw_done(s, &o);
        return 1;
    }
    o.kind = o.f->plan == STARTS ? ADDGOAL : o.f->plan == PERCEIVES ? o.f->drop ? DROPBEL : ADDBEL : o.d->what;
    o.t = !o.d ? o.f->event : o.d->pat < 0 ? -1 : gw_ground(o.d->pat, o.f->b);
    if (o.kind == ACT) return gw_act(s, &o, way);
    if (way < 0) return 1;
    s->planned = 0;
    switch (o.kind) {
    case ADDBEL: gw_add_belief(s, &o); break;
    case DROPBEL: gw_drop_belief(s, &o); break;
    case WAITS:
    case WAITSNOT: gw_wait(s, &o); break;
    case ADDGOAL: gw_add_goal(s, &o); break;
    case DROPGOAL: gw_drop_goal(s, &o); break;
    case LOCKS:
    case UNLOCKS:
        o.x.locked = o.kind == LOCKS;
        gw_done(s, &o);
        break;
    default: gw_give_up("a deed that is not known");
    }
    return 1;
}
