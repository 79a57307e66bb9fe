PRAGMA application_id=1852207988;
PRAGMA user_version=2;
BEGIN TRANSACTION;
CREATE TABLE design (only INTEGER PRIMARY KEY CHECK (only = 1), text TEXT NOT NULL) STRICT;
INSERT INTO "design" VALUES(1,'{"protocol":"forced-choice","repeats":2,"trials":3,"seed":77,"screening":{"catch":null,"catch-errors":0.25,"practice-attempts":3,"minimum-ms":300,"hasty-ms":500,"hasty-share":0.25,"untouched-share":0.5,"outlying":5.0,"bt500":true},"viewing":{"pixels-per-degree":[15.0,120.0],"distance-mm":[250.0,4000.0],"gamma":[1.4,3.0],"ambient":["dark","dim","bright"]},"questions":[],"stacks":[{"name":"wall","size":[64,32],"tile":32,"levels":[10,20,40,80,160,320],"stops":null},{"name":"door","size":[64,32],"tile":32,"levels":[10,20,40,80,160,320],"stops":null}]}');
CREATE TABLE events (
    code TEXT NOT NULL REFERENCES sessions (code), seq INTEGER NOT NULL, received_ms INTEGER NOT NULL,
    envelope TEXT NOT NULL, PRIMARY KEY (code, seq)
) STRICT, WITHOUT ROWID;
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',0,1795479682053,'{"seq":0,"at":1795479682052,"event":{"kind":"consent","language":"en"}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',1,1795479682054,'{"seq":1,"at":1795479682053,"event":{"kind":"conditions","pixels-per-mm":3.78,"distance-mm":600.0,"pixel-ratio":1.0,"zoom":1.0,"colour-depth":24,"screen-width":1920,"screen-height":1080,"gamma":2.2,"ambient":"dim"}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',2,1795479682057,'{"seq":2,"at":1795479682056,"event":{"kind":"answer","trial":0,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',3,1795479682061,'{"seq":3,"at":1795479682060,"event":{"kind":"answer","trial":1,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',4,1795479682062,'{"seq":4,"at":1795479682061,"event":{"kind":"answer","trial":2,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',5,1795479682063,'{"seq":5,"at":1795479682062,"event":{"kind":"answer","trial":3,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',6,1795479682064,'{"seq":6,"at":1795479682063,"event":{"kind":"answer","trial":4,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',7,1795479682065,'{"seq":7,"at":1795479682064,"event":{"kind":"answer","trial":5,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',8,1795479682065,'{"seq":8,"at":1795479682065,"event":{"kind":"answer","trial":6,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',9,1795479682066,'{"seq":9,"at":1795479682066,"event":{"kind":"answer","trial":7,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',10,1795479682067,'{"seq":10,"at":1795479682067,"event":{"kind":"answer","trial":8,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',11,1795479682068,'{"seq":11,"at":1795479682068,"event":{"kind":"answer","trial":9,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',12,1795479682069,'{"seq":12,"at":1795479682069,"event":{"kind":"answer","trial":10,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',13,1795479682070,'{"seq":13,"at":1795479682070,"event":{"kind":"answer","trial":11,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',14,1795479682071,'{"seq":14,"at":1795479682071,"event":{"kind":"answer","trial":12,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',15,1795479682072,'{"seq":15,"at":1795479682072,"event":{"kind":"answer","trial":13,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',16,1795479682073,'{"seq":16,"at":1795479682073,"event":{"kind":"answer","trial":14,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',17,1795479682074,'{"seq":17,"at":1795479682074,"event":{"kind":"answer","trial":15,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',18,1795479682075,'{"seq":18,"at":1795479682075,"event":{"kind":"answer","trial":16,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',19,1795479682076,'{"seq":19,"at":1795479682076,"event":{"kind":"answer","trial":17,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',20,1795479682080,'{"seq":20,"at":1795479682077,"event":{"kind":"answer","trial":18,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',21,1795479682081,'{"seq":21,"at":1795479682081,"event":{"kind":"answer","trial":19,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',22,1795479682082,'{"seq":22,"at":1795479682082,"event":{"kind":"answer","trial":20,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',23,1795479682083,'{"seq":23,"at":1795479682083,"event":{"kind":"answer","trial":21,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',24,1795479682092,'{"seq":24,"at":1795479682084,"event":{"kind":"answer","trial":22,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',25,1795479682100,'{"seq":25,"at":1795479682093,"event":{"kind":"answer","trial":23,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',26,1795479682101,'{"seq":26,"at":1795479682100,"event":{"kind":"answer","trial":24,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('2ZEPSN2RVKBD',27,1795479682102,'{"seq":27,"at":1795479682102,"event":{"kind":"answer","trial":25,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',0,1795479682107,'{"seq":0,"at":1795479682106,"event":{"kind":"consent","language":"en"}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',1,1795479682108,'{"seq":1,"at":1795479682107,"event":{"kind":"conditions","pixels-per-mm":3.78,"distance-mm":600.0,"pixel-ratio":1.0,"zoom":1.0,"colour-depth":24,"screen-width":1920,"screen-height":1080,"gamma":2.2,"ambient":"dim"}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',2,1795479682109,'{"seq":2,"at":1795479682108,"event":{"kind":"answer","trial":0,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',3,1795479682109,'{"seq":3,"at":1795479682109,"event":{"kind":"answer","trial":1,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',4,1795479682110,'{"seq":4,"at":1795479682110,"event":{"kind":"answer","trial":2,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',5,1795479682111,'{"seq":5,"at":1795479682111,"event":{"kind":"answer","trial":3,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',6,1795479682112,'{"seq":6,"at":1795479682112,"event":{"kind":"answer","trial":4,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',7,1795479682113,'{"seq":7,"at":1795479682113,"event":{"kind":"answer","trial":5,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',8,1795479682114,'{"seq":8,"at":1795479682114,"event":{"kind":"answer","trial":6,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',9,1795479682115,'{"seq":9,"at":1795479682115,"event":{"kind":"answer","trial":7,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',10,1795479682116,'{"seq":10,"at":1795479682116,"event":{"kind":"answer","trial":8,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',11,1795479682117,'{"seq":11,"at":1795479682117,"event":{"kind":"answer","trial":9,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',12,1795479682118,'{"seq":12,"at":1795479682118,"event":{"kind":"answer","trial":10,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',13,1795479682119,'{"seq":13,"at":1795479682119,"event":{"kind":"answer","trial":11,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',14,1795479682120,'{"seq":14,"at":1795479682120,"event":{"kind":"answer","trial":12,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',15,1795479682121,'{"seq":15,"at":1795479682121,"event":{"kind":"answer","trial":13,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',16,1795479682122,'{"seq":16,"at":1795479682122,"event":{"kind":"answer","trial":14,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',17,1795479682123,'{"seq":17,"at":1795479682123,"event":{"kind":"answer","trial":15,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',18,1795479682124,'{"seq":18,"at":1795479682124,"event":{"kind":"answer","trial":16,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',19,1795479682125,'{"seq":19,"at":1795479682125,"event":{"kind":"answer","trial":17,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',20,1795479682126,'{"seq":20,"at":1795479682126,"event":{"kind":"answer","trial":18,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',21,1795479682127,'{"seq":21,"at":1795479682127,"event":{"kind":"answer","trial":19,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',22,1795479682128,'{"seq":22,"at":1795479682128,"event":{"kind":"answer","trial":20,"choice":"first","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',23,1795479682129,'{"seq":23,"at":1795479682129,"event":{"kind":"answer","trial":21,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',24,1795479682130,'{"seq":24,"at":1795479682130,"event":{"kind":"answer","trial":22,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',25,1795479682131,'{"seq":25,"at":1795479682130,"event":{"kind":"answer","trial":23,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',26,1795479682132,'{"seq":26,"at":1795479682131,"event":{"kind":"answer","trial":24,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
INSERT INTO "events" VALUES('NJPP7NNWZD0M',27,1795479682133,'{"seq":27,"at":1795479682132,"event":{"kind":"answer","trial":25,"choice":"second","timing":{"onset":0,"ms":1500.0}}}');
CREATE TABLE links (
    token TEXT PRIMARY KEY, code TEXT REFERENCES sessions (code) ON DELETE SET NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE sessions (
    code TEXT PRIMARY KEY, seed INTEGER NOT NULL, observers TEXT NOT NULL, simulated INTEGER NOT NULL,
    begun_ms INTEGER NOT NULL, ids TEXT NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO "sessions" VALUES('2ZEPSN2RVKBD',-7999213708747764821,'',1,1795479682044,'{}');
INSERT INTO "sessions" VALUES('NJPP7NNWZD0M',-8119380574942610507,'',1,1795479682105,'{}');
COMMIT;
