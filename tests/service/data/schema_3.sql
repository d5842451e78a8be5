-- Tables of version 3, with rows. COUNTED is the key that each kind of database counts itself.

CREATE TABLE schema_version (
    version INTEGER NOT NULL,
    PRIMARY KEY (version)
);
INSERT INTO schema_version VALUES (3);

CREATE TABLE tenants (
    name TEXT NOT NULL,
    created DOUBLE PRECISION NOT NULL,
    weight DOUBLE PRECISION NOT NULL CHECK (weight > 0),
    flight_minutes DOUBLE PRECISION,
    cloud_calls BIGINT,
    storage_bytes BIGINT,
    max_height DOUBLE PRECISION,
    max_speed DOUBLE PRECISION,
    PRIMARY KEY (name)
);
INSERT INTO tenants VALUES ('farm', 0.0, 1.0, NULL, NULL, NULL, NULL, NULL);
INSERT INTO tenants VALUES ('t', 1.0, 2.0, 3.0, 5, 1099511627776, 6.5, 7.5);

CREATE TABLE accounts (
    name TEXT NOT NULL,
    tenant TEXT NOT NULL,
    role TEXT NOT NULL,
    scopes TEXT NOT NULL,
    created DOUBLE PRECISION NOT NULL,
    disabled BOOLEAN NOT NULL,
    subject TEXT,
    PRIMARY KEY (name),
    FOREIGN KEY(tenant) REFERENCES tenants (name),
    UNIQUE (subject)
);
INSERT INTO accounts VALUES ('pilot', 'farm', 'pilot', '["compute", "fly", "sense"]', 0.0, FALSE, NULL);
INSERT INTO accounts VALUES ('x', 'farm', 'admin', '[]', 1.0, TRUE, 'https://issuer 7');

CREATE TABLE tokens (
    id TEXT NOT NULL,
    account TEXT NOT NULL,
    digest TEXT NOT NULL,
    scopes TEXT NOT NULL,
    created DOUBLE PRECISION NOT NULL,
    expires DOUBLE PRECISION NOT NULL,
    revoked BOOLEAN NOT NULL,
    PRIMARY KEY (id),
    FOREIGN KEY(account) REFERENCES accounts (name)
);
INSERT INTO tokens VALUES ('id', 'pilot', 'd', '["fly", "sense"]', 1.0, 2.0, TRUE);

CREATE TABLE leases (
    id TEXT NOT NULL,
    number BIGINT NOT NULL,
    tenant TEXT NOT NULL,
    account TEXT NOT NULL,
    minutes DOUBLE PRECISION NOT NULL,
    asked DOUBLE PRECISION NOT NULL,
    wanted TEXT NOT NULL,
    camera BOOLEAN NOT NULL,
    within DOUBLE PRECISION,
    near TEXT NOT NULL,
    battery_minutes DOUBLE PRECISION,
    area TEXT,
    state TEXT NOT NULL,
    robots TEXT NOT NULL,
    granted DOUBLE PRECISION,
    ends DOUBLE PRECISION,
    ended DOUBLE PRECISION,
    "end" TEXT,
    reason TEXT NOT NULL,
    PRIMARY KEY (id),
    UNIQUE (number),
    FOREIGN KEY(tenant) REFERENCES tenants (name),
    FOREIGN KEY(account) REFERENCES accounts (name)
);
INSERT INTO leases VALUES ('l1', 1, 'farm', 'pilot', 0.1, 333333333.3333333, '["a", "b"]', TRUE, 12.5, '[-1.0, 2.0]', 3.0, '[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]', 'ended', '["a", "b"]', 1.0, 2.0, 1.5, 'revoked', 'wind; Böen, 風');

CREATE TABLE missions (
    id TEXT NOT NULL,
    name TEXT NOT NULL,
    tenant TEXT NOT NULL,
    account TEXT NOT NULL,
    phase TEXT NOT NULL,
    robots TEXT NOT NULL,
    submitted DOUBLE PRECISION NOT NULL,
    folder TEXT NOT NULL,
    reason TEXT NOT NULL,
    lease TEXT,
    started DOUBLE PRECISION,
    ended DOUBLE PRECISION,
    request TEXT NOT NULL,
    verdict TEXT,
    "key" TEXT,
    fingerprint TEXT,
    PRIMARY KEY (id),
    UNIQUE (tenant, "key"),
    FOREIGN KEY(tenant) REFERENCES tenants (name),
    FOREIGN KEY(account) REFERENCES accounts (name),
    FOREIGN KEY(lease) REFERENCES leases (id)
);
INSERT INTO missions VALUES ('m1', 'survey', 'farm', 'pilot', 'submitted', '["a"]', 5.0, '/somewhere/m1', '', 'l1', NULL, NULL, '{"minutes": 3.5, "share": ["campus"], "seed": null}', '{"approved": false, "reasons": ["outside the fence"]}', 'k', 'f');

CREATE TABLE robots (
    id TEXT NOT NULL,
    enabled BOOLEAN NOT NULL,
    battery DOUBLE PRECISION,
    position TEXT,
    heard DOUBLE PRECISION,
    PRIMARY KEY (id)
);
INSERT INTO robots VALUES ('a', FALSE, 0.5, '[1.0, 2.0, 3.0]', 4.0);
INSERT INTO robots VALUES ('b', TRUE, NULL, NULL, NULL);

CREATE TABLE audit (
    at DOUBLE PRECISION NOT NULL,
    account TEXT NOT NULL,
    tenant TEXT NOT NULL,
    address TEXT NOT NULL,
    action TEXT NOT NULL,
    accepted BOOLEAN NOT NULL,
    target TEXT NOT NULL,
    text TEXT NOT NULL,
    number COUNTED
);
INSERT INTO audit (at, account, tenant, address, action, accepted, target, text)
VALUES (1.0, 'pilot', 'farm', '::1', 'mission.pause', TRUE, 'm1', 'paused');

CREATE TABLE usage (
    mission TEXT NOT NULL,
    tenant TEXT NOT NULL,
    account TEXT NOT NULL,
    started DOUBLE PRECISION NOT NULL,
    flight_seconds DOUBLE PRECISION NOT NULL,
    distance DOUBLE PRECISION NOT NULL,
    battery_used DOUBLE PRECISION NOT NULL,
    compute_seconds TEXT NOT NULL,
    cloud_calls BIGINT NOT NULL,
    recorded_bytes BIGINT NOT NULL,
    kept BOOLEAN NOT NULL,
    PRIMARY KEY (mission),
    FOREIGN KEY(mission) REFERENCES missions (id),
    FOREIGN KEY(tenant) REFERENCES tenants (name),
    FOREIGN KEY(account) REFERENCES accounts (name)
);
INSERT INTO usage VALUES ('m1', 'farm', 'pilot', 5.0, 60.5, 100.25, 0.1, '{"edge": 1.5}', 8, 1099511627776, FALSE);

CREATE INDEX ix_accounts_tenant ON accounts (tenant);
CREATE INDEX ix_tokens_account ON tokens (account);
CREATE INDEX ix_leases_state ON leases (state);
CREATE INDEX ix_leases_tenant ON leases (tenant);
CREATE INDEX missions_newest ON missions (tenant, submitted);
CREATE INDEX ix_missions_phase ON missions (phase);
CREATE INDEX usage_by_month ON usage (tenant, started);
