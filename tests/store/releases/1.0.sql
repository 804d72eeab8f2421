BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('1.0');
CREATE TABLE api_keys (
	id VARCHAR(16) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	digest VARCHAR(64) NOT NULL, 
	scopes JSON NOT NULL, 
	tasks JSON, 
	created_at DATETIME NOT NULL, 
	expires_at DATETIME, 
	revoked_at DATETIME, 
	last_used_at DATETIME, 
	CONSTRAINT pk_api_keys PRIMARY KEY (id)
);
INSERT INTO "api_keys" VALUES('d2b2cc5373aa','robot','aaa116ec3403fab8c401b1dd9f5f59abc8cee22ab1ec938e01e529664c673762','["predict"]','["pick"]','2026-11-23 10:54:14.847963',NULL,NULL,NULL);
CREATE TABLE audit_log (
	number INTEGER NOT NULL, 
	at DATETIME NOT NULL, 
	actor VARCHAR(96) NOT NULL, 
	action VARCHAR(32) NOT NULL, 
	subject VARCHAR(255) NOT NULL, 
	details TEXT NOT NULL, 
	previous VARCHAR(64) NOT NULL, 
	digest VARCHAR(64) NOT NULL, 
	CONSTRAINT pk_audit_log PRIMARY KEY (number)
);
INSERT INTO "audit_log" VALUES(1,'2026-11-23 10:54:13.598606','local','limits.changed','pick','{"after":{"workspace":{"max":[0.6,0.6,1.75],"min":[-0.4,-0.4,0.7],"preset":"auto"}},"before":{"workspace":{"max":[0.7,0.5,1.6],"min":[-0.3,-0.5,0.6],"preset":"auto"}}}','0000000000000000000000000000000000000000000000000000000000000000','f88a1056169d405ca0648f94cdec03ae5cd4798b89def014ad7232cef4447307');
INSERT INTO "audit_log" VALUES(2,'2026-11-23 10:54:14.577966','local','limits.changed','pick','{"after":{"workspace":{"max":[1.0,1.0,2.0],"min":[-1.0,-1.0,0.0],"preset":null}},"before":{"workspace":{"max":[0.6,0.6,1.75],"min":[-0.4,-0.4,0.7],"preset":"auto"}}}','f88a1056169d405ca0648f94cdec03ae5cd4798b89def014ad7232cef4447307','bacc4215b0ff507fbe806c8544af5630f4741677458ec190c1d0cddb2ba968de');
INSERT INTO "audit_log" VALUES(3,'2026-11-23 10:54:14.851580','local','key.created','d2b2cc5373aa','{"name":"robot","scopes":["predict"],"tasks":["pick"]}','bacc4215b0ff507fbe806c8544af5630f4741677458ec190c1d0cddb2ba968de','9d2315857894170c7d42e907a9a58250148368ff9cd6d741fe6ce338dfb0a7ae');
CREATE TABLE blobs_of_release (data BLOB);
INSERT INTO "blobs_of_release" VALUES(X'89504E470D0A1A0A0000000D49484452000000400000003008020000002E29EB480000005C494441546805D5C101010000004020FE9FB643C99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCCC99CCC059AF5003138F61A4C0000000049454E44AE426082');
INSERT INTO "blobs_of_release" VALUES(X'89504E470D0A1A0A0000000D4948445200000040000000300800000000842023C30000008849444154480DA5C1310100000C8330F02F7A33C0D744463292918C64242319C948463292918C64242319C948463292918C244838920409479220E14812241C498284234990702409128E2441C291244838920409479220E14812241C498284234990702409128E2441C291244838920409479220E14812241C49828423C948463292918C6424A307C5F4153149C10CF60000000049454E44AE426082');
INSERT INTO "blobs_of_release" VALUES(X'89504E470D0A1A0A0000000D4948445200000040000000301000000000D4B0FF8000000076494441545809C5C101010000008220FD7FB131CD1064A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A464A40E76D929717EC79F6E0000000049454E44AE426082');
INSERT INTO "blobs_of_release" VALUES(X'89504E470D0A1A0A0000000D49484452000000400000003008020000002E29EB4800000081494441546805D5C101010000000120DEF47FA11DAAC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF26C1D9516B1D36A6EC10000000049454E44AE426082');
INSERT INTO "blobs_of_release" VALUES(X'89504E470D0A1A0A0000000D49484452000000400000003008020000002E29EB4800000081494441546805D5C1010100000001201EF67F8D1DAAC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF2ACC8B322CF8A3C2BF26CA0262D317DAE51B00000000049454E44AE426082');
CREATE TABLE episodes (
	sequence INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	id VARCHAR(32) NOT NULL, 
	task VARCHAR(64) NOT NULL, 
	instruction VARCHAR(500) NOT NULL, 
	num_frames INTEGER NOT NULL, 
	control_frequency_hz FLOAT NOT NULL, 
	created_at DATETIME NOT NULL, 
	prediction_id VARCHAR(32), 
	left_out BOOLEAN NOT NULL, 
	note VARCHAR(500) NOT NULL, 
	uploaded_instruction VARCHAR(500), 
	objects JSON NOT NULL, 
	keyframes JSON NOT NULL, 
	cameras JSON NOT NULL, 
	given_objects JSON NOT NULL, 
	extra JSON NOT NULL, 
	trajectory BLOB NOT NULL, 
	CONSTRAINT fk_episodes_task_tasks FOREIGN KEY(task) REFERENCES tasks (name), 
	CONSTRAINT uq_episodes_id UNIQUE (id)
);
INSERT INTO "episodes" VALUES(1,'60d4b0d7a74148c2bf0825ec95d26e08','pick','pick up the cube',21,20.0,'2026-11-23 10:54:13.590820',NULL,0,'',NULL,'[{"name":"cube","position":[0.1,0.1,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":""}]','[{"index":6,"position":[0.1,0.1,0.88],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":true},{"index":11,"position":[0.1,0.1,0.78],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false},{"index":20,"position":[0.1,0.1,0.93],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false}]','[{"calibration":{"name":"front","intrinsics":{"fx":60.0,"fy":60.0,"cx":31.5,"cy":23.5},"camera_to_world":[[1.0,0.0,0.0,0.0],[0.0,-1.0,0.0,0.0],[0.0,0.0,-1.0,1.0],[0.0,0.0,0.0,1.0]],"depth_scale":0.001},"rgb_digest":"07315ed17dceb61efa58521c0e2a8c6227c308ba951d42d4acedc8a4871522fc","depth_digest":"8755a0d12a3cbeed692c27b1ec92b001654d459e0549a63ce739adbf25d17793","mask_digest":null}]','[{"name":"cube","position_m":[0.1,0.1,0.78],"quaternion_xyzw":null,"mask_ids":[],"model":null}]','{"operator":"Zo\u00eb"}',X'525054317801136560606007E241086661072698C2AF97ECD00482980987BF010188068241E823BA39692676608C291C5820170304FD87BE6A0001880602BAB973105A84194460112C41B7C3B6B51F08802187148283D047747312F14127C7F5FA101000430E2904E9E6CE416811F141D77A3D109445415915118283D047747312F141F77AF10EA4420E1A827473E70320005A864AD1CD76AC16EDC40666AEDC8C29FCF1C3BB3740F0FAD5CB1740F0EAF59BB740F0011BC06A11F18248462234D9030190874A21A4078205720BB50185FE40720EC2240023694EFF');
INSERT INTO "episodes" VALUES(2,'ab82e9bb8a60481384081eb121bd5fc8','pick','pick up the cube',21,20.0,'2026-11-23 10:54:13.611553',NULL,0,'',NULL,'[{"name":"cube","position":[0.2,-0.1,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":""}]','[{"index":6,"position":[0.2,-0.1,0.88],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":true},{"index":11,"position":[0.2,-0.1,0.78],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false},{"index":20,"position":[0.2,-0.1,0.93],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false}]','[{"calibration":{"name":"front","intrinsics":{"fx":60.0,"fy":60.0,"cx":31.5,"cy":23.5},"camera_to_world":[[1.0,0.0,0.0,0.0],[0.0,-1.0,0.0,0.0],[0.0,0.0,-1.0,1.0],[0.0,0.0,0.0,1.0]],"depth_scale":0.001},"rgb_digest":"91a688d493de7f77477f1418bb588f746998b660064a04197119742cd407daa6","depth_digest":"8755a0d12a3cbeed692c27b1ec92b001654d459e0549a63ce739adbf25d17793","mask_digest":null}]','[{"name":"cube","position_m":[0.2,-0.1,0.78],"quaternion_xyzw":null,"mask_ids":[],"model":null}]','{"operator":"Zo\u00eb"}',X'525054317801136560606007E2C1084CD2676101269862AF97ECD00482980987BF0101880682C1E823BAB9C9386D2616608C29165820170304FD87BE6A0001880602BA3973305A4474D0EDB06DED070260C82185E060F411DDDC4474D0C971BD3E0404C090430A41BA3973305A4474D0B55E0F04655150564584E060F411DDDC4474D0BD5EBC03A990838620DD9CF900088096A15274B31DAB45070E1F3B890166AEDCBC13037CFCF0EE0D10BC7EF5F20510BC7AFDE62D107CC006B05A44BC209291084DF64000E4A15208E9816081DC8201F6630318AA700A50E80F2473112601009B255390');
INSERT INTO "episodes" VALUES(3,'09c38e259f584eba9f829d8d69399bea','pick','pick up the cube',21,20.0,'2026-11-23 10:54:13.623946',NULL,0,'',NULL,'[{"name":"cube","position":[0.3,0.05,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":""}]','[{"index":6,"position":[0.3,0.05,0.88],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":true},{"index":11,"position":[0.3,0.05,0.78],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false},{"index":20,"position":[0.3,0.05,0.93],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false}]','[{"calibration":{"name":"front","intrinsics":{"fx":60.0,"fy":60.0,"cx":31.5,"cy":23.5},"camera_to_world":[[1.0,0.0,0.0,0.0],[0.0,-1.0,0.0,0.0],[0.0,0.0,-1.0,1.0],[0.0,0.0,0.0,1.0]],"depth_scale":0.001},"rgb_digest":"fce5854c1324e818fa43486996d6a0e9ae958c56e4791c5f1f391c826db7c1ed","depth_digest":"8755a0d12a3cbeed692c27b1ec92b001654d459e0549a63ce739adbf25d17793","mask_digest":null}]','[{"name":"cube","position_m":[0.3,0.05,0.78],"quaternion_xyzw":null,"mask_ids":[],"model":null}]','{"operator":"Zo\u00eb"}',X'525054317801136560606007E241088C673118638059B34C666180D74B76680241CC84C3DF80004403C120F411DD9C643C134BD0CD9C693C13030416C8C50041FFA1AF1A4000A281806EEE1C8416111F743B6C5BFB81001872482138087D443727111F74725CAF0F010130E49042906EEE1C8416111F74ADD7034159149455112138087D443727111F74AF17EF402AE4A0214837773E0002A065A814DD6CC76AD1E193172E6380CE998B5762808F1FDEBD0182D7AF5EBE008257AFDFBC05820FD800568B8817443212A1C91E08803C540A213D102C905BA80D28F40792731026010032431E9E');
CREATE TABLE idempotency_keys (
	scope VARCHAR(64) NOT NULL, 
	owner VARCHAR(16) NOT NULL, 
	"key" VARCHAR(255) NOT NULL, 
	request_digest VARCHAR(64) NOT NULL, 
	status INTEGER NOT NULL, 
	response JSON NOT NULL, 
	created_at DATETIME NOT NULL, 
	CONSTRAINT pk_idempotency_keys PRIMARY KEY (scope, owner, "key")
);
INSERT INTO "idempotency_keys" VALUES('POST /episodes','','episode 0','b50f224b3cfa2aa9917f4611ebb9ad7cc0cfcbeea356f8411413d3d0ef315d29',201,'{"id":"60d4b0d7a74148c2bf0825ec95d26e08","task":"pick","instruction":"pick up the cube","num_frames":21,"control_frequency_hz":20.0,"keyframes":[{"index":6,"position":[0.1,0.1,0.88],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":true,"bins":[49,49,17,0,36,36,1],"clamped":false},{"index":11,"position":[0.1,0.1,0.78],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false,"bins":[49,49,7,0,36,36,0],"clamped":false},{"index":20,"position":[0.1,0.1,0.93],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false,"bins":[49,49,21,0,36,36,0],"clamped":false}],"objects":[{"name":"cube","position":[0.1,0.1,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":"","bins":[49,49,7]}],"cameras":["front"],"extra":{"operator":"Zo\u00eb"},"prediction_id":null,"left_out":false,"note":"","uploaded_instruction":null,"observation_text":"{''cube'': [49, 49, 7], ''pick up the cube''}>","actions_text":"[[49, 49, 17, 0, 36, 36, 1], [49, 49, 7, 0, 36, 36, 0], [49, 49, 21, 0, 36, 36, 0]]","created_at":"2026-11-23T10:54:13.590820+00:00","findings":[{"code":"coarse-recording","severity":"warning","message":"At 20 Hz the hand moves up to 6 cm between two frames: where it turned or grasped is known no better. Record more often, or move more slowly.","where":"trajectory","rate_hz":20.0,"step_m":0.060657636535600495}]}','2026-11-23 10:54:13.597604');
INSERT INTO "idempotency_keys" VALUES('POST /episodes','','episode 1','713c3f910df5953df0003326cb405ef20b5939dbd2767d478e718341961ecc02',201,'{"id":"ab82e9bb8a60481384081eb121bd5fc8","task":"pick","instruction":"pick up the cube","num_frames":21,"control_frequency_hz":20.0,"keyframes":[{"index":6,"position":[0.2,-0.1,0.88],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":true,"bins":[59,29,17,0,36,36,1],"clamped":false},{"index":11,"position":[0.2,-0.1,0.78],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false,"bins":[59,29,7,0,36,36,0],"clamped":false},{"index":20,"position":[0.2,-0.1,0.93],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false,"bins":[59,29,21,0,36,36,0],"clamped":false}],"objects":[{"name":"cube","position":[0.2,-0.1,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":"","bins":[59,29,7]}],"cameras":["front"],"extra":{"operator":"Zo\u00eb"},"prediction_id":null,"left_out":false,"note":"","uploaded_instruction":null,"observation_text":"{''cube'': [59, 29, 7], ''pick up the cube''}>","actions_text":"[[59, 29, 17, 0, 36, 36, 1], [59, 29, 7, 0, 36, 36, 0], [59, 29, 21, 0, 36, 36, 0]]","created_at":"2026-11-23T10:54:13.611553+00:00","findings":[{"code":"coarse-recording","severity":"warning","message":"At 20 Hz the hand moves up to 6 cm between two frames: where it turned or grasped is known no better. Record more often, or move more slowly.","where":"trajectory","rate_hz":20.0,"step_m":0.06248213921133973}]}','2026-11-23 10:54:13.614094');
INSERT INTO "idempotency_keys" VALUES('POST /episodes','','episode 2','4edeacb31052834173bb592aeb1d4d7cda3fa3fe4fe05c37e6445a188ec737b8',201,'{"id":"09c38e259f584eba9f829d8d69399bea","task":"pick","instruction":"pick up the cube","num_frames":21,"control_frequency_hz":20.0,"keyframes":[{"index":6,"position":[0.3,0.05,0.88],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":true,"bins":[69,44,17,0,36,36,1],"clamped":false},{"index":11,"position":[0.3,0.05,0.78],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false,"bins":[69,44,7,0,36,36,0],"clamped":false},{"index":20,"position":[0.3,0.05,0.93],"quaternion_xyzw":[1.0,0.0,0.0,0.0],"gripper_open":false,"bins":[69,44,21,0,36,36,0],"clamped":false}],"objects":[{"name":"cube","position":[0.3,0.05,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":"","bins":[69,44,7]}],"cameras":["front"],"extra":{"operator":"Zo\u00eb"},"prediction_id":null,"left_out":false,"note":"","uploaded_instruction":null,"observation_text":"{''cube'': [69, 44, 7], ''pick up the cube''}>","actions_text":"[[69, 44, 17, 0, 36, 36, 1], [69, 44, 7, 0, 36, 36, 0], [69, 44, 21, 0, 36, 36, 0]]","created_at":"2026-11-23T10:54:13.623946+00:00","findings":[{"code":"coarse-recording","severity":"warning","message":"At 20 Hz the hand moves up to 7 cm between two frames: where it turned or grasped is known no better. Record more often, or move more slowly.","where":"trajectory","rate_hz":20.0,"step_m":0.06633216577668569}]}','2026-11-23 10:54:13.626333');
INSERT INTO "idempotency_keys" VALUES('POST /predict','','one of the first release','74b1368684827d72f1ed92f1f199cce0a674aef1947e291a9b75379816b1c06c',200,'{"id":"b99a94b1125342a295beecf0c1d0aee0","actions":[{"position":[0.15,0.0,0.88],"quaternion_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"gripper_open":true,"bins":[57,49,43,0,36,36,1],"clamped":false,"anchor":{"object":"cube","frame":"w","offset_m":[0.0,0.0,0.09999999999999998],"rotation_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"tolerance_m":0.0,"tolerance_deg":0.0}},{"position":[0.15,0.0,0.78],"quaternion_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"gripper_open":false,"bins":[57,49,38,0,36,36,0],"clamped":false,"anchor":{"object":"cube","frame":"w","offset_m":[0.0,0.0,0.0],"rotation_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"tolerance_m":0.0,"tolerance_deg":0.0}},{"position":[0.15,0.0,0.93],"quaternion_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"gripper_open":false,"bins":[57,49,46,0,36,36,0],"clamped":false,"anchor":{"object":"cube","frame":"w","offset_m":[0.0,0.0,0.15000000000000002],"rotation_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"tolerance_m":0.0,"tolerance_deg":0.0}}],"task":"pick","canonical_instruction":"pick up the cube","grounding":[{"phrase":"cube","object":"cube","by":"name"}],"objects":[{"name":"cube","position":[0.15,0.0,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":""}],"model":"nearest","representation":"object_frame","prompt_format":"paper","demonstration_ids":["60d4b0d7a74148c2bf0825ec95d26e08","ab82e9bb8a60481384081eb121bd5fc8"],"prompt":{"system":"","user":"A cube 54 54 38; pick up the cube > 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0\nA cube 59 44 38; pick up the cube > 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0\nA cube 57 49 38; pick up the cube >"},"prefix_hash":"c7f7522ea26d019d","reply_text":" 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0","usage":{"prompt_tokens":78,"cached_tokens":0,"completion_tokens":25},"timings_ms":{"read":0.14994500088505447,"poses":0.1322190000792034,"prompt":11.819276998721762,"words":0.2989290005643852,"llm":0.38456800029962324,"parse":0.21807799930684268,"first_action":21.537018001254182,"write":3.8245630021265242,"total":25.599037002393743,"outside_llm":25.21446900209412},"step":null,"samples":null,"findings":[]}','2026-11-23 10:54:14.607287');
CREATE TABLE jobs (
	sequence INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	id VARCHAR(32) NOT NULL, 
	task VARCHAR(64) NOT NULL, 
	changes JSON NOT NULL, 
	status VARCHAR(16) NOT NULL, 
	num_episodes INTEGER NOT NULL, 
	num_extracted INTEGER NOT NULL, 
	error TEXT, 
	claim VARCHAR(32), 
	claimed_until DATETIME NOT NULL, 
	created_at DATETIME NOT NULL, 
	finished_at DATETIME, 
	CONSTRAINT fk_jobs_task_tasks FOREIGN KEY(task) REFERENCES tasks (name), 
	CONSTRAINT uq_jobs_id UNIQUE (id)
);
INSERT INTO "jobs" VALUES(1,'24de6b80d210455a82eb44a05ad71f56','pick','{"keyframes":{"rule":"merged"}}','done',3,3,NULL,'7d69920581704c8292ff105d86d8e073','2026-11-23 10:55:14.523702','2026-11-23 10:54:13.640222','2026-11-23 10:54:14.527421');
CREATE TABLE labels (
	sequence INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	id VARCHAR(32) NOT NULL, 
	task VARCHAR(64) NOT NULL, 
	object VARCHAR(64) NOT NULL, 
	episode_id VARCHAR(32), 
	cameras JSON NOT NULL, 
	num_pixels JSON NOT NULL, 
	yaw_deg FLOAT, 
	created_at DATETIME NOT NULL, 
	CONSTRAINT fk_labels_task_tasks FOREIGN KEY(task) REFERENCES tasks (name), 
	CONSTRAINT uq_labels_id UNIQUE (id)
);
INSERT INTO "labels" VALUES(1,'4492d621e51e43a8b420c0c0ee02427a','pick','cube','60d4b0d7a74148c2bf0825ec95d26e08','[{"calibration":{"name":"front","intrinsics":{"fx":60.0,"fy":60.0,"cx":31.5,"cy":23.5},"camera_to_world":[[1.0,0.0,0.0,0.0],[0.0,-1.0,0.0,0.0],[0.0,0.0,-1.0,1.0],[0.0,0.0,0.0,1.0]],"depth_scale":0.001},"rgb_digest":"07315ed17dceb61efa58521c0e2a8c6227c308ba951d42d4acedc8a4871522fc","depth_digest":"8755a0d12a3cbeed692c27b1ec92b001654d459e0549a63ce739adbf25d17793","mask_digest":"3e13c60ce83c845e762bf29bb6f121f1565e03e7ef348a60b3a9852c4da312ad"}]','{"front":441}',NULL,'2026-11-23 10:54:13.634021');
CREATE TABLE predictions (
	sequence INTEGER NOT NULL PRIMARY KEY AUTOINCREMENT, 
	id VARCHAR(32) NOT NULL, 
	task VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16), 
	instruction VARCHAR(500) NOT NULL, 
	model VARCHAR NOT NULL, 
	representation VARCHAR NOT NULL, 
	prompt_format VARCHAR NOT NULL, 
	step INTEGER, 
	status VARCHAR(16) NOT NULL, 
	error TEXT, 
	outcome_success BOOLEAN, 
	outcome_note TEXT, 
	outcome_at DATETIME, 
	created_at DATETIME NOT NULL, 
	demonstration_ids JSON NOT NULL, 
	timings_ms JSON NOT NULL, 
	usage JSON NOT NULL, 
	cameras JSON, 
	request JSON NOT NULL, 
	objects JSON NOT NULL, 
	grounding JSON NOT NULL, 
	findings JSON NOT NULL, 
	prompt_system TEXT NOT NULL, 
	prompt_user TEXT NOT NULL, 
	reply_text TEXT, 
	actions JSON, 
	samples JSON, 
	CONSTRAINT fk_predictions_task_tasks FOREIGN KEY(task) REFERENCES tasks (name), 
	CONSTRAINT uq_predictions_id UNIQUE (id)
);
INSERT INTO "predictions" VALUES(1,'b99a94b1125342a295beecf0c1d0aee0','pick',NULL,'pick up the cube','nearest','object_frame','paper',NULL,'ok',NULL,1,'slowly','2026-11-23 10:54:14.611779','2026-11-23 10:54:14.604763','["60d4b0d7a74148c2bf0825ec95d26e08","ab82e9bb8a60481384081eb121bd5fc8"]','{"read":0.14994500088505447,"poses":0.1322190000792034,"prompt":11.819276998721762,"words":0.2989290005643852,"llm":0.38456800029962324,"parse":0.21807799930684268,"first_action":21.537018001254182}','{"prompt_tokens":78,"cached_tokens":0,"completion_tokens":25}',NULL,'{"task":"pick","instruction":"pick up the cube","objects":[{"name":"cube","position":[0.15,0.0,0.78]}]}','[{"name":"cube","position":[0.15,0.0,0.78],"quaternion_xyzw":null,"estimator":"given","cameras":[],"confidence":1.0,"reason":""}]','{"instruction":"pick up the cube","phrases":[{"phrase":"cube","object":"cube","by":"name"}],"unfamiliar":null}','[]','','A cube 54 54 38; pick up the cube > 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0
A cube 59 44 38; pick up the cube > 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0
A cube 57 49 38; pick up the cube >',' 1 A w: +0 +0 +20 0 36 36 1; 2 A w: +0 +0 +0 0; 3 A w: +0 +0 +30 0','[{"position":[0.15,0.0,0.88],"quaternion_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"gripper_open":true,"bins":[57,49,43,0,36,36,1],"clamped":false,"anchor":{"object":"cube","frame":"w","offset_m":[0.0,0.0,0.09999999999999998],"rotation_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"tolerance_m":0.0,"tolerance_deg":0.0}},{"position":[0.15,0.0,0.78],"quaternion_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"gripper_open":false,"bins":[57,49,38,0,36,36,0],"clamped":false,"anchor":{"object":"cube","frame":"w","offset_m":[0.0,0.0,0.0],"rotation_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"tolerance_m":0.0,"tolerance_deg":0.0}},{"position":[0.15,0.0,0.93],"quaternion_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"gripper_open":false,"bins":[57,49,46,0,36,36,0],"clamped":false,"anchor":{"object":"cube","frame":"w","offset_m":[0.0,0.0,0.15000000000000002],"rotation_xyzw":[-1.0,0.0,0.0,6.123233995736766e-17],"tolerance_m":0.0,"tolerance_deg":0.0}}]',NULL);
CREATE TABLE sessions (
	digest VARCHAR(64) NOT NULL, 
	key_id VARCHAR(16) NOT NULL, 
	created_at DATETIME NOT NULL, 
	expires_at DATETIME NOT NULL, 
	CONSTRAINT pk_sessions PRIMARY KEY (digest), 
	CONSTRAINT fk_sessions_key_id_api_keys FOREIGN KEY(key_id) REFERENCES api_keys (id)
);
CREATE TABLE staged_extractions (
	job VARCHAR(32) NOT NULL, 
	episode VARCHAR(32) NOT NULL, 
	keyframes JSON NOT NULL, 
	objects JSON NOT NULL, 
	CONSTRAINT pk_staged_extractions PRIMARY KEY (job, episode), 
	CONSTRAINT fk_staged_extractions_job_jobs FOREIGN KEY(job) REFERENCES jobs (id)
);
CREATE TABLE tasks (
	name VARCHAR(64) NOT NULL, 
	version INTEGER NOT NULL, 
	settings JSON NOT NULL, 
	object_names JSON, 
	created_at DATETIME NOT NULL, 
	updated_at DATETIME NOT NULL, 
	CONSTRAINT pk_tasks PRIMARY KEY (name)
);
INSERT INTO "tasks" VALUES('pick',7,'{"workspace":{"preset":null,"min":[-1.0,-1.0,0.0],"max":[1.0,1.0,2.0]},"keyframes":{"rule":"merged","delta_rad_s":0.1,"interval":5,"tolerance_m":0.01,"tolerance_deg":15.0},"pose_estimator":"given","object_models":{},"motion_limits":{"keep_out":[],"max_step_m":null,"max_step_rotation_deg":null,"hand_radius_m":0.05},"representation":null,"prompt_format":null,"system_prompt":null,"num_demonstrations":2,"num_joints":7,"gripper_open_above_m":null,"aliases":{},"ways":"one","robot_base":[0.0,0.0,0.0],"arm":null,"yaw_symmetry_deg":{}}','["cube"]','2026-11-23 10:54:13.592870','2026-11-23 10:54:14.577558');
CREATE INDEX ix_idempotency_keys_created_at ON idempotency_keys (created_at);
CREATE INDEX ix_episodes_task_instruction_sequence ON episodes (task, instruction, sequence);
CREATE INDEX ix_episodes_task_sequence ON episodes (task, sequence);
CREATE INDEX ix_jobs_status_sequence ON jobs (status, sequence);
CREATE INDEX ix_labels_task_sequence ON labels (task, sequence);
CREATE INDEX ix_predictions_key_id_sequence ON predictions (key_id, sequence);
CREATE INDEX ix_predictions_task_sequence ON predictions (task, sequence);
CREATE INDEX ix_sessions_key_id ON sessions (key_id);
DELETE FROM "sqlite_sequence";
INSERT INTO "sqlite_sequence" VALUES('episodes',3);
INSERT INTO "sqlite_sequence" VALUES('labels',1);
INSERT INTO "sqlite_sequence" VALUES('jobs',1);
INSERT INTO "sqlite_sequence" VALUES('predictions',1);
COMMIT;
