PRAGMA application_id=1852207988;
PRAGMA user_version=2;
BEGIN TRANSACTION;
CREATE TABLE design (only INTEGER PRIMARY KEY CHECK (only = 1), text TEXT NOT NULL) STRICT;
INSERT INTO "design" VALUES(1,'{"protocol":"validation","repeats":2,"trials":3,"seed":77,"screening":{"catch":null,"catch-errors":0.25,"practice-attempts":3,"minimum-ms":300,"hasty-ms":500,"hasty-share":0.25,"untouched-share":0.5,"outlying":5.0,"bt500":true},"viewing":{"pixels-per-degree":[15.0,120.0],"distance-mm":[250.0,4000.0],"gamma":[1.4,3.0],"ambient":["dark","dim","bright"]},"questions":[],"stacks":[{"name":"wall","size":[64,32],"tile":32,"levels":[10,20,40,80,160,320],"stops":[3,3]},{"name":"door","size":[64,32],"tile":32,"levels":[10,20,40,80,160,320],"stops":[3,3]}]}');
CREATE TABLE events (
    code TEXT NOT NULL REFERENCES sessions (code), seq INTEGER NOT NULL, received_ms INTEGER NOT NULL,
    envelope TEXT NOT NULL, PRIMARY KEY (code, seq)
) STRICT, WITHOUT ROWID;
INSERT INTO "events" VALUES('664PNCVDX9FA',0,1795479681865,'{"seq":0,"at":1795479681865,"event":{"kind":"consent","language":"en"}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',1,1795479681872,'{"seq":1,"at":1795479681872,"event":{"kind":"conditions","pixels-per-mm":3.78,"distance-mm":600.0,"pixel-ratio":1.0,"zoom":1.0,"colour-depth":24,"screen-width":1920,"screen-height":1080,"gamma":2.2,"ambient":"dim"}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',2,1795479681881,'{"seq":2,"at":1795479681880,"event":{"kind":"answer","trial":0,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',3,1795479681888,'{"seq":3,"at":1795479681884,"event":{"kind":"answer","trial":1,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',4,1795479681892,'{"seq":4,"at":1795479681889,"event":{"kind":"answer","trial":2,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',5,1795479681896,'{"seq":5,"at":1795479681893,"event":{"kind":"answer","trial":3,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',6,1795479681904,'{"seq":6,"at":1795479681900,"event":{"kind":"answer","trial":4,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',7,1795479681908,'{"seq":7,"at":1795479681905,"event":{"kind":"answer","trial":5,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',8,1795479681916,'{"seq":8,"at":1795479681912,"event":{"kind":"answer","trial":6,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',9,1795479681924,'{"seq":9,"at":1795479681920,"event":{"kind":"answer","trial":7,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',10,1795479681928,'{"seq":10,"at":1795479681925,"event":{"kind":"answer","trial":8,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',11,1795479681940,'{"seq":11,"at":1795479681932,"event":{"kind":"answer","trial":9,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',12,1795479681948,'{"seq":12,"at":1795479681944,"event":{"kind":"answer","trial":10,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',13,1795479681956,'{"seq":13,"at":1795479681952,"event":{"kind":"answer","trial":11,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',14,1795479681964,'{"seq":14,"at":1795479681960,"event":{"kind":"answer","trial":12,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',15,1795479681972,'{"seq":15,"at":1795479681968,"event":{"kind":"answer","trial":13,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',16,1795479681980,'{"seq":16,"at":1795479681976,"event":{"kind":"answer","trial":14,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',17,1795479681988,'{"seq":17,"at":1795479681984,"event":{"kind":"answer","trial":15,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',18,1795479681996,'{"seq":18,"at":1795479681992,"event":{"kind":"answer","trial":16,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',19,1795479682004,'{"seq":19,"at":1795479682000,"event":{"kind":"answer","trial":17,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',20,1795479682012,'{"seq":20,"at":1795479682008,"event":{"kind":"answer","trial":18,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('664PNCVDX9FA',21,1795479682018,'{"seq":21,"at":1795479682016,"event":{"kind":"answer","trial":19,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',0,1795479681815,'{"seq":0,"at":1795479681815,"event":{"kind":"consent","language":"en"}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',1,1795479681816,'{"seq":1,"at":1795479681816,"event":{"kind":"conditions","pixels-per-mm":3.78,"distance-mm":600.0,"pixel-ratio":1.0,"zoom":1.0,"colour-depth":24,"screen-width":1920,"screen-height":1080,"gamma":2.2,"ambient":"dim"}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',2,1795479681817,'{"seq":2,"at":1795479681817,"event":{"kind":"answer","trial":0,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',3,1795479681818,'{"seq":3,"at":1795479681818,"event":{"kind":"answer","trial":1,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',4,1795479681819,'{"seq":4,"at":1795479681819,"event":{"kind":"answer","trial":2,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',5,1795479681820,'{"seq":5,"at":1795479681819,"event":{"kind":"answer","trial":3,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',6,1795479681824,'{"seq":6,"at":1795479681820,"event":{"kind":"answer","trial":4,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',7,1795479681825,'{"seq":7,"at":1795479681825,"event":{"kind":"answer","trial":5,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',8,1795479681826,'{"seq":8,"at":1795479681826,"event":{"kind":"answer","trial":6,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',9,1795479681828,'{"seq":9,"at":1795479681828,"event":{"kind":"answer","trial":7,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',10,1795479681829,'{"seq":10,"at":1795479681829,"event":{"kind":"answer","trial":8,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',11,1795479681830,'{"seq":11,"at":1795479681830,"event":{"kind":"answer","trial":9,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',12,1795479681831,'{"seq":12,"at":1795479681831,"event":{"kind":"answer","trial":10,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',13,1795479681836,'{"seq":13,"at":1795479681832,"event":{"kind":"answer","trial":11,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',14,1795479681837,'{"seq":14,"at":1795479681837,"event":{"kind":"answer","trial":12,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',15,1795479681839,'{"seq":15,"at":1795479681839,"event":{"kind":"answer","trial":13,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',16,1795479681848,'{"seq":16,"at":1795479681840,"event":{"kind":"answer","trial":14,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',17,1795479681849,'{"seq":17,"at":1795479681849,"event":{"kind":"answer","trial":15,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',18,1795479681850,'{"seq":18,"at":1795479681849,"event":{"kind":"answer","trial":16,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',19,1795479681851,'{"seq":19,"at":1795479681850,"event":{"kind":"answer","trial":17,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',20,1795479681852,'{"seq":20,"at":1795479681851,"event":{"kind":"answer","trial":18,"choice":"identical","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('CPTEK3PKF86W',21,1795479681856,'{"seq":21,"at":1795479681852,"event":{"kind":"answer","trial":19,"choice":"different","timing":{"onset":0,"ms":1500.0}}}');
CREATE TABLE links (
    token TEXT PRIMARY KEY, code TEXT REFERENCES sessions (code) ON DELETE SET NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE sessions (
    code TEXT PRIMARY KEY, seed INTEGER NOT NULL, observers TEXT NOT NULL, simulated INTEGER NOT NULL,
    begun_ms INTEGER NOT NULL, ids TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO "sessions" VALUES('664PNCVDX9FA',9041218959103012785,'',1,1795479681862,'{}');
INSERT INTO "sessions" VALUES('CPTEK3PKF86W',-4013738558653013737,'',1,1795479681814,'{}');
COMMIT;
